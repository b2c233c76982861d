#include "pipeline/simulated_drive.h"

#include <cmath>
#include <random>
#include <utility>

#include "core/matrix_matchers.h"
#include "core/random_inputs.h"
#include "matching/crowd.h"

namespace sckf::test {

int milliseconds(Stamp stamp) {
  return static_cast<int>(std::chrono::duration_cast<std::chrono::milliseconds>(stamp - at(0)).count());
}

SE2 roundDrive(double t) {
  const double u = 2.0 * M_PI * t / 15.0;
  const double radius = 1.2 + 0.2 * std::sin(3.0 * u);
  const double growth = 0.6 * std::cos(3.0 * u);
  const double heading = std::atan2(growth * std::sin(u) + radius * std::cos(u),  //
                                    growth * std::cos(u) - radius * std::sin(u));
  return {0.4 + radius * std::cos(u), radius * std::sin(u), heading};
}

SimulatedDrive::SimulatedDrive(const Wheels& wheels, int duration_ms, World world, std::function<SE2(double)> path)
    : world_(std::move(world)), path_(std::move(path)), seed_(wheels.seed) {
  laser.noise = 0.01;
  RandomInputs random(wheels.seed);
  wheels_.push_back(wheels.start);
  for (int ms = 0; ms < duration_ms; ++ms) {
    const SE2 motion = between(path_(1e-3 * ms), path_(1e-3 * (ms + 1)));
    const bool slips = ms >= wheels.stand_still_from && ms < wheels.stand_still_to;
    const double way = motion.translation().norm();
    const double scale = wheels.scale * (ms >= wheels.spin_from && ms < wheels.spin_to ? wheels.spin : 1.0);
    const Eigen::Vector2d rolled = motion.translation() - way * (truth(ms).rotation().transpose() * wheels.pile);
    const SE2 meant(scale * rolled.x(), scale * rolled.y(),
                    motion.yaw + wheels.yaw_per_meter * way + (ms == wheels.yaw_slip_at ? wheels.yaw_slip : 0.0));
    const Eigen::Vector3d noise = random.drawnFrom(modelledIncrement(meant, wheels.noise).covariance);
    wheels_.push_back(slips ? wheels_.back() : compose(wheels_.back(), corrected(meant, noise)));
  }
}

OdometrySample SimulatedDrive::odometry(int ms) const {
  OdometrySample sample;
  sample.stamp = at(ms);
  sample.odom_from_base = wheels_.at(static_cast<std::size_t>(ms));
  return sample;
}

LaserScan SimulatedDrive::scan(int ms) const {
  return scanAlong([this, ms](double t) { return path_(1e-3 * ms + t); }, ms);
}

LaserScan SimulatedDrive::scanDisplaced(int ms, const SE2& by) const {
  return scanAlong([this, ms, by](double t) { return compose(path_(1e-3 * ms + t), by); }, ms);
}

LaserScan SimulatedDrive::scanAlong(const std::function<SE2(double)>& world_from_base_at, int ms) const {
  std::mt19937_64 random(static_cast<std::uint64_t>(ms) + 1000000 * seed_);
  LaserScan scan = simulateSweep(world_, world_from_base_at, laser, &random);
  scan.stamp = at(ms);
  return scan;
}

LaserScan scanOfACrowd(const SimulatedDrive& drive, int ms) {
  std::mt19937_64 random(static_cast<std::uint64_t>(ms));
  return amongPeople(drive.scan(ms), random);
}

::testing::AssertionResult sound(const Estimate& estimate) {
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
    if (smallestEigenvalue(P) < -1e-12 * P.norm()) return fail("covariance not positive semi-definite");
  }
  return ::testing::AssertionSuccess();
}

CalibrationOptions noCalibration() {
  CalibrationOptions options;
  options.distance_std = options.rotation_std = options.rotation_per_meter_std = 0.0;
  options.laser_ahead_std = options.floor_std = 0.0;
  return options;
}

PipelineOptions withMethod(const std::string& method) {
  PipelineOptions options;
  options.method = method;
  return options;
}

Driven::Driven(const SimulatedDrive& drive, const PipelineOptions& options, const SE2& start,
               const Eigen::Matrix3d& covariance)
    : drive_(drive), told_mount(drive.laser.base_from_laser), pipeline(options, start, covariance) {}

void Driven::odometry(int ms) {
  pipeline.addOdometry(drive_.odometry(ms));
  process();
}

void Driven::scan(const LaserScan& scan) {
  pipeline.addScan(scan, told_mount);
  process();
}

void Driven::run(int from, int to, int period) {
  for (int ms = from + 1; ms <= to; ++ms) {
    if (ms % 20 == 0) odometry(ms);
    if (ms % period == 7) scan(ms);
  }
}

void Driven::scansOnly(int from, int to) {
  for (int ms = from + 1; ms <= to; ++ms) {
    if (ms % 100 == 7) scan(ms);
  }
}

void Driven::process() {
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

Eigen::Vector3d Driven::latestError(int ms) const {
  return error(pipeline.latest().value().odom_from_base, drive_.truth(ms));
}

std::size_t Driven::count(ScanOutcome outcome) const {
  std::size_t n = 0;
  for (const ScanReport& report : reports) n += report.outcome == outcome ? 1 : 0;
  return n;
}

void expectNear(const Estimate& a, const Estimate& b, double tolerance) {
  EXPECT_EQ(a.stamp, b.stamp);
  const Eigen::Vector3d difference = error(a.odom_from_base, b.odom_from_base);
  EXPECT_LE(difference.cwiseAbs().maxCoeff(), tolerance) << difference.transpose() << " at " << milliseconds(a.stamp);
  EXPECT_TRUE(matricesNear(a.covariance, b.covariance, tolerance));
}

void expectAccurate(const SimulatedDrive& drive, const Driven& driven, double tolerance) {
  for (const ScanReport& report : driven.reports) {
    ASSERT_TRUE(report.estimate) << toString(report.outcome) << ": " << report.reason;
    const Eigen::Vector3d e = error(report.estimate->odom_from_base, drive.truth(milliseconds(report.stamp)));
    EXPECT_LT(e.head<2>().norm(), tolerance) << "at " << milliseconds(report.stamp) << " ms: " << e.transpose();
    EXPECT_LT(std::abs(e.z()), 0.5 * tolerance) << "at " << milliseconds(report.stamp) << " ms: " << e.transpose();
  }
}

}  // namespace sckf::test
