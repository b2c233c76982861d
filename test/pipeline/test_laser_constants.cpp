// Constants of a laser: the filter for them by hand values, and on drives with lasers that have them.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "pipeline/simulated_drive.h"
#include "sckf_odometry/pipeline/laser_constants.h"

namespace sckf::test {
namespace {

/// Thirty matches count as one.
ConstantEvidence told(double value, double std, double bias_std = 0.0) { return {value, 30.0 / (std * std), bias_std}; }

TEST(LaserConstant, IsTheMeanOfNoneAndOfWhatIsToldByTheirVariances) {
  LaserConstant constant(0.02);
  EXPECT_EQ(constant.value(), 0.0);
  EXPECT_NEAR(constant.variance(), 4e-4, 1e-18);
  constant.add(told(0.03, 0.02), 0.0);
  EXPECT_NEAR(constant.value(), 0.015, 1e-15);
  EXPECT_NEAR(constant.variance(), 2e-4, 1e-18);
  constant.add(told(0.02, 0.02), 0.015);  // what is left beside what is added already: 0.035 in all
  EXPECT_NEAR(constant.value(), 0.0325 * 2.0 / 3.0, 1e-15);
  EXPECT_NEAR(constant.variance(), 4e-4 / 3.0, 1e-18);
}

TEST(LaserConstant, ABiasIsNotAveragedByManyMatches) {
  LaserConstant constant(0.02);
  for (int i = 0; i < 100000; ++i) constant.add(told(0.03 - constant.value(), 0.02, 0.02), constant.value());
  EXPECT_NEAR(constant.value(), 0.015, 1e-6);
  EXPECT_NEAR(constant.variance(), 2e-4, 1e-8);
}

TEST(LaserConstant, NoSingleMatchMovesItFarAndWhatTellsNothingDoesNotAtAll) {
  LaserConstant constant(0.03);
  constant.add(told(-10.0, 0.04), 0.0);
  EXPECT_NEAR(constant.value(), -3.0 * 0.05 * 0.36, 1e-15);  // three std, times the share of what is told
  const double before = constant.value();
  constant.add({0.02, 0.0, 0.0}, before);
  constant.add({0.02, std::numeric_limits<double>::quiet_NaN(), 0.0}, before);
  EXPECT_EQ(constant.value(), before);
}

TEST(LaserConstant, WithoutStdThereIsNoneAndAnotherStdBeginsAnew) {
  LaserConstant constant(0.0);
  constant.add(told(0.03, 0.001), 0.0);
  EXPECT_EQ(constant.value(), 0.0);
  EXPECT_EQ(constant.variance(), 0.0);
  constant.setStd(0.02);
  constant.add(told(0.03, 0.02), 0.0);
  constant.setStd(0.02);
  EXPECT_NEAR(constant.value(), 0.015, 1e-15);
  constant.setStd(0.01);
  EXPECT_EQ(constant.value(), 0.0);
}

using Std = double PipelineOptions::*;  // of a constant

PipelineOptions estimating(Std constant, double std) {
  PipelineOptions options;
  options.*constant = std;
  return options;
}

constexpr Std kRangeOffset = &PipelineOptions::range_offset_std;
constexpr Std kSweepDuration = &PipelineOptions::sweep_duration_std;

TEST(RangeOffset, IsFoundOnADrive) {
  for (const double error : {0.03, 0.0, -0.03}) {
    SimulatedDrive drive({}, 31000);
    drive.laser.offset = error;
    Driven driven(drive, estimating(kRangeOffset, 0.03));
    driven.run(0, 30000);
    const LaserConstant& found = driven.reports.back().laser_constants.range_offset;
    EXPECT_NEAR(found.value(), -error, 3.0 * std::sqrt(found.variance())) << "of " << error;
    EXPECT_NEAR(found.value(), -error, 0.01) << "of " << error;
    EXPECT_LT(std::sqrt(found.variance()), 0.009);
  }
}

/// Of scans that are near each other nothing can be told but what noise makes up, and that always to the same side.
TEST(RangeOffset, ScansOneAfterTheOtherDoNotLetItRunAway) {
  PipelineOptions options = estimating(kRangeOffset, 0.015);
  options.method = "sckf";
  options.reference.kf_dist_linear = 0.0;
  SimulatedDrive drive({}, 121000, room(),
                       [](double t) { return SE2(std::sin(0.1 * t), 0.0, 0.5 * std::sin(0.2 * t)); });
  drive.laser.noise = 0.02;
  Driven driven(drive, options);
  driven.run(0, 120000);
  const LaserConstant& found = driven.reports.back().laser_constants.range_offset;
  EXPECT_LT(std::abs(found.value()), 0.003) << "of none; without a least derivative: 0.12";
}

/// Along a corridor with a straight wall to the right and pillars to the left: without an estimate each match turns the
/// robot to the same side.
TEST(RangeOffset, ItsEstimateKeepsARobotInACorridorStraight) {
  World hall = {{{-5.0, -0.8}, {40.0, -0.8}}, {{-5.0, 2.5}, {-5.0, -0.8}}, {{40.0, -0.8}, {40.0, 2.5}}};
  for (double x = -4.0; x < 40.0; x += 3.0) {
    const World pillar = closedPolygon({{x, 2.0}, {x + 0.8, 2.0}, {x + 0.8, 2.5}, {x, 2.5}});
    hall.insert(hall.end(), pillar.begin(), pillar.end());
  }
  const auto yawAfter = [&](double std) {
    SimulatedDrive drive({}, 61000, hall, [](double t) { return SE2(0.5 * t, 0.0, 0.0); });
    drive.laser = frontLaser();
    drive.laser.noise = 0.005;
    drive.laser.offset = -0.03;
    Driven driven(drive, estimating(kRangeOffset, std));
    driven.run(0, 60000);
    return std::abs(driven.latestError(60000).z());
  };
  const double with = yawAfter(0.03);
  const double without = yawAfter(0.0);
  EXPECT_GT(without, 0.02) << "else there is nothing to be shown";
  EXPECT_LT(with, 0.5 * without);
}

TEST(RangeOffset, EachLaserHasItsOwn) {
  PipelineOptions options = estimating(kRangeOffset, 0.03);
  options.lasers = 2;
  SimulatedDrive front;
  front.laser.offset = 0.03;
  SimulatedDrive rear;
  rear.laser.offset = -0.03;
  ScanOdometry pipeline(options);
  LaserConstant found[2];
  for (int ms = 1; ms <= 15000; ++ms) {
    if (ms % 20 == 0) pipeline.addOdometry(front.odometry(ms));
    if (ms % 100 == 7) pipeline.addScan(front.scan(ms), front.laser.base_from_laser, 0);
    if (ms % 100 == 57) pipeline.addScan(rear.scan(ms), rear.laser.base_from_laser, 1);
    for (const ScanReport& report : pipeline.process()) found[report.laser] = report.laser_constants.range_offset;
  }
  EXPECT_NEAR(found[0].value(), -0.03, 0.01);
  EXPECT_NEAR(found[1].value(), 0.03, 0.01);
}

SimulatedDrive sweptDrive(double duration) {
  SimulatedDrive drive({}, 61000);
  drive.laser.time_increment = duration / (drive.laser.beams - 1);
  return drive;
}

TEST(SweepDuration, IsFoundOnADrive) {
  for (const double duration : {0.04, 0.0, -0.04}) {
    const SimulatedDrive drive = sweptDrive(duration);
    Driven driven(drive, estimating(kSweepDuration, 0.03));
    driven.run(0, 60000);
    const LaserConstant& found = driven.reports.back().laser_constants.sweep_duration;
    EXPECT_NEAR(found.value(), duration, 3.0 * std::sqrt(found.variance())) << "of " << duration;
    EXPECT_NEAR(found.value(), duration, 0.006) << "of " << duration;
    EXPECT_LT(std::sqrt(found.variance()), 0.008) << "of " << duration;
  }
}

/// Each scan is compared with the last one, so that their errors add up.
TEST(SweepDuration, ItsEstimateKeepsTheYaw) {
  const auto yawAfter = [](double std) {
    const SimulatedDrive drive = sweptDrive(0.04);
    PipelineOptions options = estimating(kSweepDuration, std);
    options.method = "sckf";
    options.reference.kf_dist_linear = 0.0;
    Driven driven(drive, options);
    driven.run(0, 60000);
    return std::abs(driven.latestError(60000).z());
  };
  const double with = yawAfter(0.03);
  const double without = yawAfter(0.0);
  EXPECT_GT(without, 0.02) << "rad, else there is nothing to be shown";
  EXPECT_LT(with, 0.4 * without);
}

TEST(SweepDuration, NothingIsToldOfItWhereTheMotionIsUndoneOrCannotBe) {
  const auto expectNothing = [](const PipelineOptions& options, const std::function<SE2(double)>& path) {
    SimulatedDrive drive({}, 11000, room(), path);
    drive.laser.time_increment = 0.04 / (drive.laser.beams - 1);
    Driven driven(drive, options);
    driven.run(0, 10000);
    EXPECT_EQ(driven.reports.back().laser_constants.sweep_duration.value(), 0.0);
    EXPECT_NEAR(driven.reports.back().laser_constants.sweep_duration.variance(), 9e-4, 1e-18);
  };
  PipelineOptions deskewing = estimating(kSweepDuration, 0.03);
  deskewing.deskew = true;
  expectNothing(deskewing, roundDrive);
  PipelineOptions slow = estimating(kSweepDuration, 0.03);
  slow.motion.max_speed = 0.2;
  expectNothing(slow, [](double t) { return SE2(0.3 * t - 1.0, 0.0, 0.0); });
  PipelineOptions straight = estimating(kSweepDuration, 0.03);
  straight.motion.max_yaw_rate = 0.2;
  expectNothing(straight, [](double t) { return SE2(0.0, 0.0, 0.3 * t); });
}

TEST(SweepDuration, StaysWhenThePoseIsSetAndBeginsAnewWithAnotherStd) {
  const SimulatedDrive drive = sweptDrive(0.04);
  Driven driven(drive, estimating(kSweepDuration, 0.03));
  driven.run(0, 5000);
  const double found = driven.reports.back().laser_constants.sweep_duration.value();
  EXPECT_GT(found, 0.005);
  driven.pipeline.setPose(SE2(), Eigen::Matrix3d::Zero(), at(5000));
  driven.run(5020, 5120);
  EXPECT_EQ(driven.reports.back().laser_constants.sweep_duration.value(), found) << "of one scan nothing is told";
  driven.run(5140, 10000);
  driven.pipeline.setOptions(estimating(kSweepDuration, 0.0));
  driven.run(10020, 10500);
  EXPECT_EQ(driven.reports.back().laser_constants.sweep_duration.variance(), 0.0);
  EXPECT_EQ(driven.reports.back().scan->sweep.duration, 0.0);
}

}  // namespace
}  // namespace sckf::test
