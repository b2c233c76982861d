// What can be switched on beside wheels and scans, through the pipeline.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

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
  options.calibration.on = true;
  Driven driven(drive, options);
  driven.odometry(0);
  driven.run(0, 30000);
  const WheelCalibration& found = driven.reports.back().calibration;
  const Eigen::Vector3d std = found.covariance.diagonal().cwiseSqrt();
  EXPECT_NEAR(found.error(0), 1.0 / 1.05 - 1.0, 3.0 * std(0));
  EXPECT_NEAR(found.error(2), -0.05 / 1.05, 3.0 * std(2));
  EXPECT_LT(found.error(0), -0.02) << "half of it at least";
  EXPECT_LT(std(0), 0.6 * options.calibration.distance_std);
  expectAccurate(drive, driven);
}

TEST(OtherSensors, WheelsThatHaveBeenFoundOutLeadABlindRobotBetter) {
  const SimulatedDrive drive(tooLong(), 37000);
  PipelineOptions options;
  const double without = errorAfterBlindStretch(drive, options);
  options.calibration.on = true;
  const double with = errorAfterBlindStretch(drive, options);
  EXPECT_GT(without, 0.2) << "the drive is no test: the wheels are good enough";
  EXPECT_LT(with, 0.5 * without);
}

TEST(OtherSensors, ACalibrationThatIsOffIsNone) {
  const SimulatedDrive drive(tooLong(), 3000);
  Driven driven(drive);
  driven.odometry(0);
  driven.run(0, 2000);
  EXPECT_TRUE(driven.reports.back().calibration.covariance.isZero(0.0));
}

TEST(OtherSensors, MethodsWithoutSuchStatesRefuseThemByName) {
  for (const std::string& method : fusionMethodNames()) {
    PipelineOptions options = withMethod(method);
    options.calibration.on = true;
    if (method == "sckf_multi") {
      EXPECT_NO_THROW(ScanOdometry{options});
    } else {
      expectRefused(options, "calibrate_odometry");
    }
  }
}

}  // namespace
}  // namespace sckf::test
