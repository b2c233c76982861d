// A robot on a drive through a simulated room: what its wheels and its laser say, and where it really is.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "matching/simulated_world.h"
#include "sckf_odometry/pipeline/scan_odometry.h"

namespace sckf::test {

/// Time since the start of the drive in whole milliseconds.
inline Stamp at(int ms) { return std::chrono::seconds(1000) + std::chrono::milliseconds(ms); }

int milliseconds(Stamp stamp);

/// A weaving round about the room's middle in 15 s: 0.3 to 0.7 m/s, and all headings.
SE2 roundDrive(double t);

struct Wheels {
  double scale = 1.03;          ///< of the way
  double yaw_per_meter = 0.03;  ///< [rad/m], to the left
  Eigen::Vector2d pile = Eigen::Vector2d::Zero();  ///< [m/m] of a carpet: takes the robot along, in the start's frame
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
                          std::function<SE2(double)> path = roundDrive);

  /// In the frame of the robot's start, as estimates are.
  SE2 truth(int ms) const { return between(path_(0.0), path_(1e-3 * ms)); }
  SE2 wheels(int ms) const { return between(wheels_.front(), wheels_.at(static_cast<std::size_t>(ms))); }

  OdometrySample odometry(int ms) const;
  /// The same scan however often and in whatever order one asks.
  LaserScan scan(int ms) const;
  /// A scan with that stamp from a pose that is so far off the true one.
  LaserScan scanDisplaced(int ms, const SE2& by) const;

  SimulatedLaser laser;

 private:
  LaserScan scanAlong(const std::function<SE2(double)>& world_from_base_at, int ms) const;

  World world_;
  std::function<SE2(double)> path_;
  std::uint64_t seed_;
  std::vector<SE2> wheels_;  // each millisecond, in the driver's frame
};

/// A scan of people all around who move: at no place does it look like another.
LaserScan scanOfACrowd(const SimulatedDrive& drive, int ms);

/// Whether an estimate can be believed at all: finite, its covariances symmetric and positive semi-definite.
::testing::AssertionResult sound(const Estimate& estimate);

/// Wheels and mount are taken for right.
CalibrationOptions noCalibration();

PipelineOptions withMethod(const std::string& method);

/// A pipeline with what it has reported. Looks at every estimate that comes out, whether it is sound.
class Driven {
 public:
  explicit Driven(const SimulatedDrive& drive, const PipelineOptions& options = {}, const SE2& start = SE2(),
                  const Eigen::Matrix3d& covariance = Eigen::Matrix3d::Zero());

  void odometry(int ms);
  void scan(int ms) { scan(drive_.scan(ms)); }
  void scan(const LaserScan& scan);

  /// Odometry at 50 Hz over (from, to], a scan each period [ms], 7 ms after a sample of it and so between two.
  void run(int from, int to, int period = 100);
  /// Scans at 10 Hz over (from, to], and no odometry.
  void scansOnly(int from, int to);
  void process();

  Eigen::Vector3d latestError(int ms) const;
  std::size_t count(ScanOutcome outcome) const;

 private:
  const SimulatedDrive& drive_;

 public:
  Eigen::Isometry3d told_mount;  ///< base_link from the laser, as the pipeline is told: the true one
  ScanOdometry pipeline;
  std::vector<ScanReport> reports;
};

/// Whether two estimates, of one instant, are the same but for so much.
void expectNear(const Estimate& a, const Estimate& b, double tolerance);

/// Whether every scan was used, and the estimate at it is where the robot was.
void expectAccurate(const SimulatedDrive& drive, const Driven& driven, double tolerance = 0.04);

}  // namespace sckf::test
