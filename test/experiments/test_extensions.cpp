#include <gtest/gtest.h>

#include <boost/math/distributions/chi_squared.hpp>

#include "sckf_odometry/experiments/cloud_input.h"
#include "sckf_odometry/experiments/deskewing.h"
#include "sckf_odometry/experiments/odometry_models.h"

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

}  // namespace
}  // namespace sckf
