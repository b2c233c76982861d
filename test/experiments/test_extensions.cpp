#include <gtest/gtest.h>

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>

#include "sckf_odometry/experiments/absolute_poses.h"
#include "sckf_odometry/experiments/cloud_input.h"
#include "sckf_odometry/experiments/deskewing.h"
#include "sckf_odometry/experiments/mounted_lasers.h"
#include "sckf_odometry/experiments/odometry_models.h"
#include "sckf_odometry/experiments/other_measurements.h"

namespace sckf {
namespace {

constexpr auto kNoTick = [] {};

TEST(OdometryModels, EachFitsTheRobotOfItsKind) {
  OdometryModelsOptions options;
  options.runs = 300;
  const boost::math::chi_squared sum(3 * options.runs);
  const double low = boost::math::quantile(sum, 0.0005) / options.runs;
  const double high = boost::math::quantile(sum, 0.9995) / options.runs;
  for (const OdometryModelsRow& row : simulateOdometryModels(options, kNoTick)) {
    if (row.robot != row.model) continue;
    EXPECT_LT(row.nees, high) << row.robot;
    // Where a bend is on the way of a wheel the model adds what the mechanics do not.
    EXPECT_GT(row.nees, row.robot == "differential" ? 0.85 * low : low) << row.robot;
  }
}

TEST(OdometryModels, TheSameSeedIsTheSameRobots) {
  OdometryModelsOptions options;
  options.runs = 5;
  const auto a = simulateOdometryModels(options, kNoTick);
  const auto b = simulateOdometryModels(options, kNoTick);
  options.seed = 6;
  const auto other = simulateOdometryModels(options, kNoTick);
  ASSERT_EQ(a.size(), 9U);
  EXPECT_EQ(a[4].nees, b[4].nees);
  EXPECT_NE(a[4].nees, other[4].nees);
}

TEST(DeskewingExperiment, WithoutMotionDuringAScanNothingChanges) {
  DeskewingOptions options;
  options.run.duration = 2.0;
  options.sweep = 1e-6;
  const DeskewingPoint point = simulateDeskewing(options, {1.0}, kNoTick).front();
  EXPECT_EQ(point.with.scans, point.without.scans);
  EXPECT_NEAR(point.with.yaw, point.without.yaw, 1e-5);
}

TEST(CloudInputExperiment, EveryCloudOfTheBandIsUsed) {
  CloudInputOptions options;
  options.run.duration = 2.0;
  const auto rows = simulateCloudInput(options, {720}, kNoTick);
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_EQ(rows[1].input, "cloud");
  EXPECT_EQ(rows[1].errors.used, rows[1].errors.scans - 1) << "all but the first, which is the reference";
  EXPECT_LT(rows[1].errors.position, 0.05);
}

TEST(MountedLasersExperiment, EachScanIsUsedAndBothAreTheScansOfEach) {
  MountedLasersOptions options;
  options.drives = 2;
  options.run.duration = 2.0;
  const auto rows = simulateMountedLasers(options, kNoTick);
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_EQ(rows[0].errors.scans, 2 * 80);
  EXPECT_EQ(rows[1].errors.scans, 2 * 10);
  for (const MountedLasersRow& row : rows) {
    const int references = row.lasers == "both" ? 4 : 2;  // the first scan of each laser and drive
    EXPECT_EQ(row.errors.used, row.errors.scans - references) << row.lasers;
    EXPECT_LT(row.errors.position, 0.05) << row.lasers;
  }
  EXPECT_GT(rows[2].errors.scans, rows[0].errors.scans);
}

TEST(AbsolutePosesExperiment, OdomIsLeftAloneAndMapIsNot) {
  AbsolutePosesOptions options;
  options.run.duration = 4.0;
  const auto points = simulateAbsolutePoses(options);
  ASSERT_GT(points.size(), 30U);
  EXPECT_TRUE(std::isnan(points.front().map_error)) << "before the first pose";
  double largest_step = 0.0;
  for (const AbsolutePosesPoint& p : points) {
    EXPECT_EQ(p.moved, 0.0) << p.time;
    EXPECT_LT(p.odom_step, 0.005) << p.time;
    if (!std::isnan(p.map_step)) largest_step = std::max(largest_step, p.map_step);
  }
  EXPECT_GT(largest_step, 0.01);
  EXPECT_LT(points.back().map_error, 0.15);
}

TEST(OtherMeasurementsExperiment, TracesTheFirstRobot) {
  OtherMeasurementsOptions options;
  options.runs = 2;
  options.scans = 5;
  const SensorStatistics s = simulateOtherMeasurements(everySensor(), options);
  for (const TracedState& traced : {s.traced_bias, s.traced_scale}) {
    ASSERT_EQ(traced.truth.size(), 5U);
    ASSERT_EQ(traced.estimate.size(), 5U);
    EXPECT_GT(traced.std.back(), 0.0);
    EXPECT_LT(std::abs(traced.truth.back() - traced.estimate.back()), 5.0 * traced.std.back());
  }
}

}  // namespace
}  // namespace sckf
