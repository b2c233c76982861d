// A robot on a drive through a simulated room: what its wheels and its laser say, and where it really is.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <functional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "core/matrix_matchers.h"
#include "core/random_inputs.h"
#include "matching/simulated_world.h"
#include "sckf_odometry/pipeline/scan_odometry.h"

namespace sckf::test {

/// Time since the start of the drive in whole milliseconds.
inline Stamp at(int ms) { return std::chrono::seconds(1000) + std::chrono::milliseconds(ms); }

inline int milliseconds(Stamp stamp) {
  return static_cast<int>(std::chrono::duration_cast<std::chrono::milliseconds>(stamp - at(0)).count());
}

/// A weaving round about the room's middle in 15 s: 0.3 to 0.7 m/s, and all headings.
inline SE2 roundDrive(double t) {
  const double u = 2.0 * M_PI * t / 15.0;
  const double radius = 1.2 + 0.2 * std::sin(3.0 * u);
  const double growth = 0.6 * std::cos(3.0 * u);
  const double heading = std::atan2(growth * std::sin(u) + radius * std::cos(u),  //
                                    growth * std::cos(u) - radius * std::sin(u));
  return {0.4 + radius * std::cos(u), radius * std::sin(u), heading};
}

struct Wheels {
  double scale = 1.03;          ///< of the way
  double yaw_per_meter = 0.03;  ///< [rad/m], to the left
  int stand_still_from = 0;     ///< [ms] they slip: they report no motion …
  int stand_still_to = 0;       ///< [ms] … until here
  double spin = 1.0;            ///< they spin: they report so many times the way made …
  int spin_from = 0;            ///< [ms] … from here …
  int spin_to = 0;              ///< [ms] … until here
  int yaw_slip_at = -1;         ///< [ms] then they report a rotation …
  double yaw_slip = 0.0;        ///< [rad] … that there is none of
  SE2 start = SE2(5, -3, 3.0);  ///< where the driver's own frame puts the robot at first: near the wrap of the yaw
  OdometryNoise noise{0.0, 0.0, 0.0, 0.0};
  std::uint64_t seed = 0;  ///< of the noise of wheels and laser
};

class SimulatedDrive {
 public:
  explicit SimulatedDrive(const Wheels& wheels = {}, int duration_ms = 16000, World world = room(),
                          std::function<SE2(double)> path = roundDrive)
      : world_(std::move(world)), path_(std::move(path)), seed_(wheels.seed) {
    laser.noise = 0.01;
    RandomInputs random(wheels.seed);
    wheels_.push_back(wheels.start);
    for (int ms = 0; ms < duration_ms; ++ms) {
      const SE2 motion = between(path_(1e-3 * ms), path_(1e-3 * (ms + 1)));
      const bool slips = ms >= wheels.stand_still_from && ms < wheels.stand_still_to;
      const double way = motion.translation().norm();
      const double scale = wheels.scale * (ms >= wheels.spin_from && ms < wheels.spin_to ? wheels.spin : 1.0);
      const SE2 meant(scale * motion.x, scale * motion.y,
                      motion.yaw + wheels.yaw_per_meter * way + (ms == wheels.yaw_slip_at ? wheels.yaw_slip : 0.0));
      const Eigen::Vector3d noise = random.drawnFrom(modelledIncrement(meant, wheels.noise).covariance);
      wheels_.push_back(slips ? wheels_.back() : compose(wheels_.back(), corrected(meant, noise)));
    }
  }

  /// In the frame of the robot's start, as estimates are.
  SE2 truth(int ms) const { return between(path_(0.0), path_(1e-3 * ms)); }
  SE2 wheels(int ms) const { return between(wheels_.front(), wheels_.at(static_cast<std::size_t>(ms))); }

  OdometrySample odometry(int ms) const {
    OdometrySample sample;
    sample.stamp = at(ms);
    sample.odom_from_base = wheels_.at(static_cast<std::size_t>(ms));
    return sample;
  }

  /// The same scan however often and in whatever order one asks.
  LaserScan scan(int ms) const {
    return scanAlong([this, ms](double t) { return path_(1e-3 * ms + t); }, ms);
  }

  /// A scan with that stamp from a pose that is so far off the true one.
  LaserScan scanDisplaced(int ms, const SE2& by) const {
    return scanAlong([this, ms, by](double t) { return compose(path_(1e-3 * ms + t), by); }, ms);
  }

  SimulatedLaser laser;

 private:
  LaserScan scanAlong(const std::function<SE2(double)>& world_from_base_at, int ms) const {
    std::mt19937_64 random(static_cast<std::uint64_t>(ms) + 1000000 * seed_);
    LaserScan scan = simulateSweep(world_, world_from_base_at, laser, &random);
    scan.stamp = at(ms);
    return scan;
  }

  World world_;
  std::function<SE2(double)> path_;
  std::uint64_t seed_;
  std::vector<SE2> wheels_;  // each millisecond, in the driver's frame
};

/// A scan of people all around who move: at no place does it look like another.
inline LaserScan scanOfACrowd(const SimulatedDrive& drive, int ms) {
  constexpr std::size_t kWidth = 6;  // of a person, in beams
  LaserScan scan = drive.scan(ms);
  std::mt19937_64 random(static_cast<std::uint64_t>(ms));
  std::uniform_real_distribution<double> distance(0.3, 2.5);
  std::normal_distribution<double> noise(0.0, 0.02);
  double near = 0.0;
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    if (i % kWidth == 0) near = distance(random);
    scan.ranges[i] = static_cast<float>(near + noise(random));
  }
  return scan;
}

/// Whether an estimate can be believed at all: finite, its covariances symmetric and positive semi-definite.
inline ::testing::AssertionResult sound(const Estimate& estimate) {
  const auto fail = [&estimate](const char* what) {
    return ::testing::AssertionFailure() << what << "\npose " << estimate.odom_from_base.vector().transpose()
                                         << "\ncovariance\n"
                                         << estimate.covariance << "\ntwist " << estimate.twist.mean.transpose()
                                         << "\nits covariance\n"
                                         << estimate.twist.covariance;
  };
  if (!estimate.odom_from_base.vector().allFinite()) return fail("pose not finite");
  if (!estimate.twist.mean.allFinite()) return fail("twist not finite");
  for (const Eigen::Matrix3d& P : {estimate.covariance, estimate.twist.covariance}) {
    if (!P.allFinite()) return fail("covariance not finite");
    if (!P.isApprox(P.transpose(), 1e-12) && !P.isZero(0.0)) return fail("covariance not symmetric");
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(P, Eigen::EigenvaluesOnly);
    if (eigen.eigenvalues().minCoeff() < -1e-12 * P.norm()) return fail("covariance not positive semi-definite");
  }
  return ::testing::AssertionSuccess();
}

/// Wheels and mount are taken for right.
inline CalibrationOptions noCalibration() {
  CalibrationOptions options;
  options.distance_std = options.rotation_std = options.rotation_per_meter_std = options.laser_ahead_std = 0.0;
  return options;
}

inline PipelineOptions withMethod(const std::string& method) {
  PipelineOptions options;
  options.method = method;
  return options;
}

/// A pipeline with what it has reported. Looks at every estimate that comes out, whether it is sound.
class Driven {
 public:
  explicit Driven(const SimulatedDrive& drive, const PipelineOptions& options = {}, const SE2& start = SE2(),
                  const Eigen::Matrix3d& covariance = Eigen::Matrix3d::Zero())
      : drive_(drive), told_mount(drive.laser.base_from_laser), pipeline(options, start, covariance) {}

  void odometry(int ms) {
    pipeline.addOdometry(drive_.odometry(ms));
    process();
  }
  void scan(int ms) { scan(drive_.scan(ms)); }
  void scan(const LaserScan& scan) {
    pipeline.addScan(scan, told_mount);
    process();
  }

  /// Odometry at 50 Hz over (from, to], a scan each period [ms], 7 ms after a sample of it and so between two.
  void run(int from, int to, int period = 100) {
    for (int ms = from + 1; ms <= to; ++ms) {
      if (ms % 20 == 0) odometry(ms);
      if (ms % period == 7) scan(ms);
    }
  }

  /// Scans at 10 Hz over (from, to], and no odometry.
  void scansOnly(int from, int to) {
    for (int ms = from + 1; ms <= to; ++ms) {
      if (ms % 100 == 7) scan(ms);
    }
  }

  void process() {
    for (ScanReport& report : pipeline.process()) {
      if (report.estimate) {
        EXPECT_TRUE(sound(*report.estimate));
      }
      reports.push_back(std::move(report));
    }
    if (pipeline.latest()) {
      EXPECT_TRUE(sound(*pipeline.latest()));
    }
  }

  Eigen::Vector3d latestError(int ms) const {
    return error(pipeline.latest().value().odom_from_base, drive_.truth(ms));
  }

  std::size_t count(ScanOutcome outcome) const {
    std::size_t n = 0;
    for (const ScanReport& report : reports) n += report.outcome == outcome ? 1 : 0;
    return n;
  }

 private:
  const SimulatedDrive& drive_;

 public:
  Eigen::Isometry3d told_mount;  ///< base_link from the laser, as the pipeline is told: the true one
  ScanOdometry pipeline;
  std::vector<ScanReport> reports;
};

/// Whether two estimates, of one instant, are the same but for so much.
inline void expectNear(const Estimate& a, const Estimate& b, double tolerance) {
  EXPECT_EQ(a.stamp, b.stamp);
  const Eigen::Vector3d difference = error(a.odom_from_base, b.odom_from_base);
  EXPECT_LE(difference.cwiseAbs().maxCoeff(), tolerance) << difference.transpose() << " at " << milliseconds(a.stamp);
  EXPECT_TRUE(matricesNear(a.covariance, b.covariance, tolerance));
}

/// Whether every scan was used, and the estimate at it is where the robot was.
inline void expectAccurate(const SimulatedDrive& drive, const Driven& driven, double tolerance = 0.04) {
  for (const ScanReport& report : driven.reports) {
    ASSERT_TRUE(report.estimate) << toString(report.outcome) << ": " << report.reason;
    const Eigen::Vector3d e = error(report.estimate->odom_from_base, drive.truth(milliseconds(report.stamp)));
    EXPECT_LT(e.head<2>().norm(), tolerance) << "at " << milliseconds(report.stamp) << " ms: " << e.transpose();
    EXPECT_LT(std::abs(e.z()), 0.5 * tolerance) << "at " << milliseconds(report.stamp) << " ms: " << e.transpose();
  }
}

}  // namespace sckf::test
