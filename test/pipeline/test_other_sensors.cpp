// What can be switched on beside wheels and scans, through the pipeline.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/matrix_matchers.h"
#include "pipeline/simulated_drive.h"

namespace sckf::test {
namespace {

void expectRefused(const PipelineOptions& options, const std::string& parameter) {
  try {
    ScanOdometry{options};
    FAIL() << parameter << " not refused";
  } catch (const std::invalid_argument& refusal) {
    EXPECT_THAT(refusal.what(), testing::HasSubstr(parameter));
    EXPECT_THAT(refusal.what(), testing::HasSubstr("\"" + options.method + "\""));
    EXPECT_THAT(refusal.what(), testing::HasSubstr("\"sckf_multi\""));
  }
}

/// The robot's error after a stretch that its laser did not see [m].
double errorAfterBlindStretch(const SimulatedDrive& drive, const PipelineOptions& options) {
  Driven driven(drive, options);
  driven.odometry(0);
  driven.run(0, 30000);
  const SE2 before = driven.pipeline.latest()->odom_from_base;
  for (int ms = 30020; ms <= 36000; ms += 20) driven.odometry(ms);
  const SE2 moved = between(before, driven.pipeline.latest()->odom_from_base);
  return error(moved, between(drive.truth(30000), drive.truth(36000))).head<2>().norm();
}

// ---- systematic errors of the wheels

Wheels tooLong() {
  Wheels wheels;
  wheels.scale = 1.05;
  wheels.yaw_per_meter = 0.05;
  return wheels;
}

TEST(OtherSensors, WheelsThatAreTooLongAreFoundOut) {
  const SimulatedDrive drive(tooLong(), 31000);
  PipelineOptions options;
  Driven driven(drive, options);
  driven.odometry(0);
  driven.run(0, 30000);
  const WheelCalibration& found = driven.reports.back().calibration;
  const WheelCalibration::Vector std = found.covariance.diagonal().cwiseSqrt();
  EXPECT_NEAR(found.error(0), 1.0 / 1.05 - 1.0, 3.0 * std(0));
  EXPECT_NEAR(found.error(2), -0.05 / 1.05, 3.0 * std(2));
  EXPECT_LT(found.error(0), -0.024) << "half of it at least";
  EXPECT_LT(std(0), 0.7 * options.calibration.distance_std);
  expectAccurate(drive, driven);
}

TEST(OtherSensors, WheelsThatHaveBeenFoundOutLeadABlindRobotBetter) {
  const SimulatedDrive drive(tooLong(), 37000);
  PipelineOptions options;
  options.calibration = noCalibration();
  const double without = errorAfterBlindStretch(drive, options);
  options.calibration = CalibrationOptions();
  const double with = errorAfterBlindStretch(drive, options);
  EXPECT_GT(without, 0.2) << "the drive is no test: the wheels are good enough";
  EXPECT_LT(with, 0.5 * without);
}

/// A drive whose laser is farther ahead than its mount says, and the mean square of the innovation across the way.
double acrossWithLaserAhead(const PipelineOptions& options, double ahead, WheelCalibration* found) {
  const SimulatedDrive drive({}, 31000);
  Driven driven(drive, options);
  driven.told_mount.translation().x() -= ahead;
  driven.odometry(0);
  driven.run(0, 30000);
  *found = driven.reports.back().calibration;
  double sum = 0.0;
  for (const ScanReport& report : driven.reports) {
    if (!report.match.displacement) continue;
    const Eigen::Vector3d r =
        error(report.match.displacement->reference_from_current, report.prediction.reference_from_current);
    sum += r.y() * r.y() / static_cast<double>(driven.reports.size());
  }
  return sum;
}

TEST(OtherSensors, ALaserThatIsFartherAheadThanToldIsFoundOutByDefault) {
  PipelineOptions options;
  options.calibration = noCalibration();
  WheelCalibration found;
  const double without = acrossWithLaserAhead(options, 0.08, &found);
  options.calibration = CalibrationOptions();
  const double with = acrossWithLaserAhead(options, 0.08, &found);
  const double std = std::sqrt(found.covariance(3, 3));
  EXPECT_NEAR(found.error(3), 0.08, 3.0 * std);
  EXPECT_LT(std, 0.5 * options.calibration.laser_ahead_std);
  EXPECT_LT(with, 0.3 * without) << "of the innovations across the way";
  acrossWithLaserAhead(options, -0.05, &found);
  EXPECT_NEAR(found.error(3), -0.05, 3.0 * std);
}

/// Good wheels on a carpet.
Wheels onACarpet() {
  Wheels wheels;
  wheels.scale = 1.0;
  wheels.yaw_per_meter = 0.0;
  wheels.pile = {0.02, -0.015};
  return wheels;
}

TEST(OtherSensors, ACarpetIsFoundOutByDefaultAndWhereItLiesStaysKnown) {
  const SimulatedDrive drive(onACarpet(), 91000);
  const PipelineOptions options;
  Driven driven(drive, options);
  driven.odometry(0);
  driven.run(0, 90000);
  const WheelCalibration found = driven.reports.back().calibration;
  const Eigen::Vector2d std = found.covariance.diagonal().tail<2>().cwiseSqrt();
  EXPECT_NEAR(found.error(4), 0.02, 3.0 * std.x());
  EXPECT_NEAR(found.error(5), -0.015, 3.0 * std.y());
  EXPECT_GT(found.error.tail<2>().norm(), 0.5 * onACarpet().pile.norm()) << "half of it at least";
  EXPECT_LT(std.maxCoeff(), 0.7 * options.calibration.floor_std);
  expectAccurate(drive, driven);

  const SE2 before = driven.pipeline.latest()->odom_from_base;
  driven.pipeline.setPose(compose(SE2(3.0, 2.0, 1.0), before), Eigen::Matrix3d::Zero(), at(90000));
  EXPECT_TRUE(matricesNear(driven.pipeline.found().calibration->error, found.turned(1.0).error, 1e-3));

  ScanOdometry paused(options, before, Eigen::Matrix3d::Zero(), {found, {}, {}});
  paused.setPose(compose(SE2(3.0, 2.0, 1.0), before), Eigen::Matrix3d::Zero(), at(45000));
  paused.addOdometry(drive.odometry(90000));
  EXPECT_TRUE(matricesNear(paused.found().calibration->error, found.turned(1.0).error, 1e-3)) << "before any odometry";
}

TEST(OtherSensors, ACarpetThatHasBeenFoundOutLeadsABlindRobotBetter) {
  const SimulatedDrive drive(onACarpet(), 37000);
  PipelineOptions options;
  options.calibration.floor_std = 0.0;
  const double without = errorAfterBlindStretch(drive, options);
  options.calibration.floor_std = 0.03;
  const double with = errorAfterBlindStretch(drive, options);
  EXPECT_GT(without, 0.03) << "the drive is no test: the floor is smooth enough";
  EXPECT_LT(with, 0.6 * without);
}

/// One side of a corridor along x: doors, in their frames, where chance puts them. side: 1, -1.
void addDoors(double side, std::mt19937_64& random, World& world) {
  std::uniform_real_distribution<double> chance(0.0, 1.0);
  Eigen::Vector2d last(-15.0, side);
  const auto wallTo = [&](double x, double y) {
    world.push_back({last, {x, side * y}});
    last = {x, side * y};
  };
  for (double x = -13.0; x < 95.0; x += 2.0 + 3.0 * chance(random)) {
    const double width = 0.8 + 0.8 * chance(random);
    const double depth = 0.05 + 0.25 * chance(random);
    wallTo(x, 1.0);
    wallTo(x, 1.0 + depth);
    wallTo(x + width, 1.0 + depth);
    wallTo(x + width, 1.0);
    x += width;
  }
  wallTo(105.0, 1.0);
}

/// How far off along a corridor a robot is after 75 m of it, whose wheels tell 5 % too much.
double errorAlongDoors(const PipelineOptions& options, WheelCalibration* found) {
  World world;
  std::mt19937_64 random(3);
  addDoors(1.0, random, world);
  addDoors(-1.0, random, world);
  Wheels wheels;
  wheels.scale = 1.05;
  SimulatedDrive drive(wheels, 151000, world,
                       [](double t) { return SE2(0.5 * t, 0.1 * std::sin(t), 0.1 * std::cos(t)); });
  drive.laser = frontLaser();
  drive.laser.noise = 0.01;
  drive.laser.range_max = 20.0;
  Driven driven(drive, options);
  driven.odometry(0);
  driven.run(0, 150000, 1000);
  *found = driven.reports.back().calibration;
  return std::abs(driven.latestError(150000).x());
}

TEST(OtherSensors, WheelsThatTellTooLongAWayAreFoundOutByDefaultAndACorridorIsNotTooLong) {
  PipelineOptions options;
  WheelCalibration found;
  const double with = errorAlongDoors(options, &found);
  EXPECT_NEAR(found.error(0), 1.0 / 1.05 - 1.0, 3.0 * std::sqrt(found.covariance(0, 0)));
  EXPECT_LT(std::sqrt(found.covariance(0, 0)), 0.6 * options.calibration.distance_std)
      << "but for what the floor may do";
  options.calibration.distance_std = options.calibration.floor_std = 0.0;
  const double without = errorAlongDoors(options, &found);
  EXPECT_GT(without, 0.5) << "the corridor is no test: scans see the way well enough";
  EXPECT_LT(with, 0.5 * without);
}

TEST(OtherSensors, ACalibrationThatIsOffIsNone) {
  const SimulatedDrive drive(tooLong(), 3000);
  PipelineOptions options;
  options.calibration = noCalibration();
  Driven driven(drive, options);
  driven.odometry(0);
  driven.run(0, 2000);
  EXPECT_TRUE(driven.reports.back().calibration.covariance.isZero(0.0));
}

TEST(OtherSensors, MethodsWithoutSuchStatesRefuseThemByName) {
  for (const std::string& method : fusionMethodNames()) {
    PipelineOptions options = withMethod(method);
    const std::vector<std::pair<std::string, bool*>> switches{{"use_imu", &options.imu.gyro},
                                                              {"use_imu_orientation", &options.imu.orientation},
                                                              {"use_pose_updates", &options.pose_updates.on}};
    for (const auto& [parameter, is_on] : switches) {
      *is_on = true;
      if (method == "sckf_multi") {
        EXPECT_NO_THROW(ScanOdometry{options});
      } else {
        expectRefused(options, parameter);
      }
      *is_on = false;
    }
    options.standstill.time = 1.0;
    if (method != "sckf_multi") expectRefused(options, "standstill_time is 1");
  }
}

// ---- gyro and orientation

/// An IMU at 100 Hz whose gyro has a bias, and whose world is turned; its messages come a little later than their
/// stamps.
struct SimulatedImu {
  const SimulatedDrive& drive;
  double bias = 0.03;   // [rad/s]
  double turned = 2.0;  // [rad]
  int delay = 15;       // [ms]
  int silent_from = 1000000;

  ImuSample at(int ms) const {
    const double h = 1e-3;
    const double rate = between(drive.truth(ms - 1), drive.truth(ms + 1)).yaw / (2.0 * h);
    return {test::at(ms), rate + bias, wrapAngle(drive.truth(ms).yaw + turned)};
  }

  /// Odometry at 50 Hz, scans at 10 Hz (or none), and the IMU, over (from, to].
  void run(Driven& driven, int from, int to, bool scans = true) const {
    for (int ms = from + 1; ms <= to; ++ms) {
      const int stamp = ms - delay;
      if (stamp % 10 == 0 && stamp > 0 && stamp < silent_from) driven.pipeline.addImu(at(stamp));
      if (ms % 20 == 0) driven.odometry(ms);
      if (scans && ms % 100 == 7) driven.scan(ms);
      driven.process();
    }
  }
};

Wheels turningWrongly() {
  Wheels wheels;
  wheels.scale = 1.0;
  wheels.yaw_per_meter = 0.3;
  return wheels;
}

PipelineOptions withGyro() {
  PipelineOptions options;
  options.imu.gyro = true;
  options.imu.gyro_noise = 0.001;
  options.imu.gyro_bias_std = 0.05;
  return options;
}

/// The error of the yaw after 6 s without scans.
double yawErrorWithoutScans(const SimulatedDrive& drive, const SimulatedImu& imu, const PipelineOptions& options) {
  Driven driven(drive, options);
  driven.odometry(0);
  imu.run(driven, 0, 10000);
  const double before = driven.latestError(10000).z();
  imu.run(driven, 10000, 16000, false);
  return std::abs(wrapAngle(driven.latestError(16000).z() - before));
}

TEST(OtherSensors, AGyroHoldsTheHeadingWhereWheelsAndScansDoNot) {
  const SimulatedDrive drive(turningWrongly(), 18000);
  const SimulatedImu imu{drive};
  const double without = yawErrorWithoutScans(drive, imu, {});
  const double with = yawErrorWithoutScans(drive, imu, withGyro());
  EXPECT_GT(without, 0.5) << "the drive is no test: the wheels are good enough";
  EXPECT_LT(with, 0.05);
}

TEST(OtherSensors, TheBiasOfTheGyroIsFound) {
  const SimulatedDrive drive(turningWrongly(), 18000);
  const SimulatedImu imu{drive};
  Driven driven(drive, withGyro());
  driven.odometry(0);
  imu.run(driven, 0, 10000);
  const ScanReport& last = driven.reports.back();
  EXPECT_NEAR(last.gyro_bias.value, imu.bias, 3.0 * std::sqrt(last.gyro_bias.variance));
  EXPECT_NEAR(last.gyro_bias.value, imu.bias, 0.01);
  EXPECT_NEAR(last.gyro_time, 0.1, 1e-9) << "every scan waits until the gyro tells all";
  expectAccurate(drive, driven);
}

TEST(OtherSensors, AGyroThatFallsSilentIsNotWaitedFor) {
  const SimulatedDrive drive(turningWrongly(), 18000);
  SimulatedImu imu{drive};
  imu.silent_from = 3000;
  Driven driven(drive, withGyro());
  driven.odometry(0);
  imu.run(driven, 0, 10000);
  EXPECT_EQ(driven.reports.size(), 100U);
  EXPECT_EQ(driven.reports.back().gyro_time, 0.0);
  EXPECT_LE(driven.pipeline.waitingScans(), 1U);
  expectAccurate(drive, driven);
}

TEST(OtherSensors, WhenReadingsOfTheGyroComeMakesNoDifference) {
  const SimulatedDrive drive(turningWrongly(), 18000);
  SimulatedImu early{drive};
  early.delay = 0;
  SimulatedImu late{drive};
  late.delay = 70;
  Driven a(drive, withGyro());
  Driven b(drive, withGyro());
  a.odometry(0);
  b.odometry(0);
  a.pipeline.addImu(early.at(1));  // before the first scan both have to tell all
  b.pipeline.addImu(early.at(1));
  early.run(a, 0, 5000);
  late.run(b, 0, 5100);
  ASSERT_GE(b.reports.size(), a.reports.size());
  for (std::size_t i = 0; i < a.reports.size(); ++i) {
    expectNear(a.reports[i].estimate.value(), b.reports[i].estimate.value(), 0.0);
  }
}

TEST(OtherSensors, AHeadingHoldsTheYawWhereWheelsAndScansDoNot) {
  const SimulatedDrive drive(turningWrongly(), 18000);
  const SimulatedImu imu{drive};
  PipelineOptions options;
  options.imu.orientation = true;
  options.imu.orientation_std = 0.01;
  options.imu.heading_drift = 0.0005;
  options.scan.min_points = 1000;  // no scan can be used
  Driven driven(drive, options);
  driven.odometry(0);
  imu.run(driven, 0, 10000);
  EXPECT_EQ(driven.count(ScanOutcome::kUnusable), driven.reports.size());
  EXPECT_EQ(driven.reports.back().heading, HeadingUse::kUsed);
  EXPECT_LT(std::abs(driven.reports.back().estimate->odom_from_base.yaw - drive.truth(9907).yaw), 0.05);
}

TEST(OtherSensors, AHeadingThatContradictsIsNotUsed) {
  const SimulatedDrive drive;
  SimulatedImu imu{drive};
  PipelineOptions options;
  options.imu.orientation = true;
  options.imu.orientation_std = 0.01;
  Driven driven(drive, options);
  driven.odometry(0);
  imu.run(driven, 0, 2000);
  imu.turned += 1.0;
  imu.run(driven, 2000, 3000);
  EXPECT_EQ(driven.reports.back().heading, HeadingUse::kContradicts);
  expectAccurate(drive, driven);
}

TEST(OtherSensors, AHeadingIsUsedOnceHoweverManyLasersSeeAtThatInstant) {
  const SimulatedDrive drive;
  const SimulatedImu imu{drive};
  PipelineOptions options;
  options.imu.orientation = true;
  options.lasers = 2;
  Driven driven(drive, options);
  driven.odometry(0);
  driven.pipeline.addImu(imu.at(1));
  for (int ms = 1; ms <= 1000; ++ms) {
    if (ms % 10 == 0) driven.pipeline.addImu(imu.at(ms));
    if (ms % 20 == 0) driven.odometry(ms);
    for (const std::size_t laser : {0U, 1U}) {
      if (ms % 100 == 7) driven.pipeline.addScan(drive.scan(ms), drive.laser.base_from_laser, laser);
    }
    driven.process();
  }
  ASSERT_GT(driven.reports.size(), 15U);
  for (std::size_t i = 0; i + 1 < driven.reports.size(); i += 2) {
    ASSERT_EQ(driven.reports[i].stamp, driven.reports[i + 1].stamp);
    EXPECT_EQ(driven.reports[i].heading, HeadingUse::kUsed);
    EXPECT_EQ(driven.reports[i + 1].heading, HeadingUse::kNone);
  }
}

// ---- standstill

/// Encoders of a robot that stands tell of motion now and then.
OdometrySample jitter(int ms, double size) {
  OdometrySample sample;
  sample.stamp = at(ms);
  const int n = ms / 20;
  sample.odom_from_base = SE2(size * (n % 2), 0.0, size * (n / 2 % 2));
  return sample;
}

Eigen::Matrix3d covarianceAfterStanding(const PipelineOptions& options, double size) {
  ScanOdometry pipeline(options);
  for (int ms = 0; ms <= 20000; ms += 20) pipeline.addOdometry(jitter(ms, size));
  return pipeline.latest()->covariance;
}

TEST(OtherSensors, ARobotThatStandsKnowsIt) {
  PipelineOptions options;
  const Eigen::Matrix3d without = covarianceAfterStanding(options, 1e-4);
  options.standstill.time = 1.0;
  const Eigen::Matrix3d with = covarianceAfterStanding(options, 1e-4);
  EXPECT_LT(with.trace(), 0.2 * without.trace());
  const double bound = 20.0 * options.standstill.std * options.standstill.std;
  const Eigen::Matrix3d first_second = covarianceAfterStanding({}, 1e-4) / 20.0;
  EXPECT_LT(with(0, 0), 1.2 * (bound + first_second(0, 0)));
  const Eigen::Matrix3d faster = covarianceAfterStanding(options, 1e-3);  // 0.05 m/s
  EXPECT_TRUE(matricesNear(faster, covarianceAfterStanding({}, 1e-3), 0.0)) << "no standstill";
}

TEST(OtherSensors, TheBiasOfAGyroIsFoundWhileTheRobotStands) {
  PipelineOptions options = withGyro();
  options.standstill.time = 0.5;
  ScanOdometry pipeline(options);
  const SimulatedDrive drive;
  std::vector<ScanReport> reports;
  for (int ms = 0; ms <= 8000; ms += 10) {
    pipeline.addImu({at(ms), 0.03, {}});
    if (ms % 20 == 0) pipeline.addOdometry(jitter(ms, 1e-4));
    if (ms % 200 == 10) {
      LaserScan blind = drive.scan(0);
      blind.stamp = at(ms);
      std::fill(blind.ranges.begin(), blind.ranges.end(), 0.0F);
      pipeline.addScan(blind, drive.laser.base_from_laser);
    }
    for (ScanReport& report : pipeline.process()) reports.push_back(std::move(report));
  }
  EXPECT_FALSE(reports.front().stands);
  EXPECT_TRUE(reports.back().stands);
  EXPECT_NEAR(reports.back().gyro_bias.value, 0.03, 0.003);
  EXPECT_LT(std::sqrt(reports.back().gyro_bias.variance), 0.005);
}

}  // namespace
}  // namespace sckf::test
