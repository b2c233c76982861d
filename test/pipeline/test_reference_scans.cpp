#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/simulated_drive.h"
#include "sckf_odometry/core/multi_clone_filter.h"
#include "sckf_odometry/core/stochastic_cloning_filter.h"
#include "sckf_odometry/pipeline/reference_scans.h"

namespace sckf::test {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

const Eigen::Matrix3d kSmall = 1e-6 * Eigen::Matrix3d::Identity();

/// References along the way of a filter, the last at its pose.
struct Way {
  explicit Way(FusionMethod& f, int kept = 16) : filter(f), kept(kept) {}

  void add(const SE2& step, std::size_t laser = 0) {
    filter.propagate({step, kSmall});
    filter.clone(Eigen::VectorXd::Constant(1, 1e-4));
    scans.add(std::make_shared<PreparedScan>(), laser, kept, filter);
  }

  FusionMethod& filter;
  int kept;
  ReferenceScans scans;
};

ReferenceOptions limits(int compared) {
  ReferenceOptions options;
  options.older_compared = compared;
  options.older_dist_linear = 3.0;
  options.older_dist_angular = 1.5;
  return options;
}

TEST(ReferenceScans, TheOneBeforeComesFirstThenTheNearest) {
  MultiCloneFilter filter(SE2(), kSmall);
  Way way(filter);
  for (int i = 0; i < 6; ++i) way.add(SE2(1.0, 0.0, 0.0));  // at 1 … 6
  filter.propagate({SE2(-3.8, 0.0, 0.0), kSmall});          // back to 2.2: clones 0 … 5 are at 6 … 1
  EXPECT_THAT(way.scans.worthComparing(0, filter, limits(3)), ElementsAre(1U, 4U, 3U))
      << "5 is 2.8 m away, then 2 and 3";
  EXPECT_THAT(way.scans.worthComparing(0, filter, limits(1)), ElementsAre(1U));
  EXPECT_THAT(way.scans.worthComparing(0, filter, limits(0)), IsEmpty());
}

TEST(ReferenceScans, WhatIsFarOrTurnedIsNotCompared) {
  MultiCloneFilter filter(SE2(), kSmall);
  Way way(filter);
  for (int i = 0; i < 3; ++i) way.add(SE2(2.0, 0.0, 0.0));
  EXPECT_THAT(way.scans.worthComparing(0, filter, limits(9)), ElementsAre(1U)) << "the other is 4 m away";
  filter.propagate({SE2(0.0, 0.0, 1.6), kSmall});
  EXPECT_THAT(way.scans.worthComparing(0, filter, limits(9)), IsEmpty()) << "turned by more than 1.5 rad";
}

TEST(ReferenceScans, WhatWasNearBeforeThePoseBecameUncertainIsComparedFromTwiceAsFar) {
  MultiCloneFilter filter(SE2(), kSmall);
  Way way(filter);
  way.add(SE2(1.0, 0.0, 0.0));
  way.add(SE2(2.0, 0.0, 0.0));
  filter.distrustWheels(0.2 * 0.2 * Eigen::Matrix3d::Identity());
  way.add(SE2(1.0, 0.0, 0.0));
  way.add(SE2(0.5, 0.0, 0.0));
  filter.propagate({SE2(2.0, 0.0, 1.6), kSmall});  // clones 0 … 3 are 2, 2.5, 3.5 and 5.5 m away
  EXPECT_THAT(way.scans.worthComparing(0, filter, limits(9)), ElementsAre(2U)) << "1 is turned by more than 1.5 rad";
  filter.propagate({SE2(0.0, 0.0, -1.6), kSmall});
  EXPECT_THAT(way.scans.worthComparing(0, filter, limits(9)), ElementsAre(1U, 2U, 3U));
}

TEST(ReferenceScans, ForgetsTheNewestOfALaser) {
  MultiCloneFilter filter(SE2(), kSmall);
  Way way(filter);
  for (const std::size_t laser : {0, 1, 0, 1}) way.add(SE2(0.1, 0.0, 0.0), laser);
  way.scans.forgetNewestOf(0, filter);
  ASSERT_EQ(filter.clones(), 3U);
  EXPECT_NEAR(filter.clonedPose(*way.scans.newestOf(0)).x, 0.1, 1e-9);
  EXPECT_NEAR(filter.clonedPose(*way.scans.newestOf(1)).x, 0.4, 1e-9);
}

TEST(ReferenceScans, ForgetsTheOldest) {
  MultiCloneFilter filter(SE2(), kSmall);
  Way way(filter, 3);
  for (int i = 0; i < 10; ++i) {
    way.add(SE2(0.1, 0.0, 0.0));
    EXPECT_EQ(filter.clones(), static_cast<std::size_t>(std::min(i + 1, 3)));
  }
  EXPECT_NEAR(filter.clonedPose(2).x, 0.8, 1e-9);
  EXPECT_THAT(way.scans.worthComparing(0, filter, limits(9)), ElementsAre(1U, 2U));
}

TEST(ReferenceScans, AMethodWithOneCloneHasNoOlderOnes) {
  StochasticCloningFilter filter(SE2(), kSmall);
  Way way(filter);
  for (int i = 0; i < 5; ++i) way.add(SE2(0.1, 0.0, 0.0));
  EXPECT_THAT(way.scans.worthComparing(0, filter, limits(9)), IsEmpty());
}

TEST(ReferenceScans, LasersHaveTheirOwn) {
  MultiCloneFilter filter(SE2(), kSmall);
  Way way(filter, 3);
  EXPECT_FALSE(way.scans.newestOf(0));
  for (int i = 0; i < 8; ++i) {  // clones, the newest first: of the lasers 0 0 0 1 0 0 0 1, of which six are kept
    way.add(SE2(0.1, 0.0, 0.0), i % 4 == 0 ? 1 : 0);
  }
  EXPECT_EQ(filter.clones(), 5U) << "three of the first laser, two of the second";
  EXPECT_EQ(way.scans.newestOf(0), 0U);
  EXPECT_EQ(way.scans.newestOf(1), 3U);
  EXPECT_FALSE(way.scans.newestOf(2));
  EXPECT_NEAR(filter.clonedPose(3).x, 0.5, 1e-9);
  EXPECT_NEAR(filter.clonedPose(4).x, 0.1, 1e-9) << "that of the second laser outlives older ones of the first";
  EXPECT_THAT(way.scans.worthComparing(0, filter, limits(9)), ElementsAre(1U, 2U));
  EXPECT_THAT(way.scans.worthComparing(1, filter, limits(9)), ElementsAre(4U));
}

/// Round after round in one room: what one reference after the other adds up to, older ones take back.
TEST(ScanOdometry, OlderReferencesHoldTheEstimate) {
  const SimulatedDrive drive(Wheels(), 46000);
  double drift[2];
  for (const bool older : {false, true}) {
    PipelineOptions options;
    options.method = "sckf_multi";
    options.reference.older_compared = older ? 2 : 0;
    Driven driven(drive, options);
    driven.odometry(0);
    driven.run(0, 45000);
    int compared = 0;
    for (const ScanReport& report : driven.reports) {
      compared += report.older_references;
      EXPECT_TRUE(report.new_reference || report.older_references == 0);
    }
    EXPECT_EQ(compared > 20, older) << compared;
    double sum = 0.0;
    for (const ScanReport& report : driven.reports) {
      sum += error(report.estimate->odom_from_base, drive.truth(milliseconds(report.stamp))).head<2>().norm();
    }
    drift[older ? 1 : 0] = sum / static_cast<double>(driven.reports.size());
  }
  EXPECT_LT(drift[1], 0.8 * drift[0]) << "mean error in metres, with " << drift[1] << " and without " << drift[0];
}

/// Displacements of one scan err alike in part: the more is allowed for it, the less certain the estimate.
TEST(ScanOdometry, WhatDisplacementsHaveInCommonIsAllowedFor) {
  const SimulatedDrive drive(Wheels(), 26000);
  double grown[2];
  for (const bool allowed : {false, true}) {
    PipelineOptions options;
    options.reference.kept = 4;  // so that the start, which is known exactly, is forgotten
    options.reference.older_inflation = allowed ? 4.0 : 1.0;
    Driven driven(drive, options);
    driven.odometry(0);
    driven.run(0, 25000);
    const auto yaw_variance = [](const ScanReport& report) { return report.estimate->covariance(2, 2); };
    grown[allowed ? 1 : 0] = yaw_variance(driven.reports.back()) - yaw_variance(driven.reports.front());
  }
  EXPECT_GT(grown[1], 1.5 * grown[0]) << "variance of yaw, with " << grown[1] << ", without " << grown[0] << " rad²";
}

/// By how much larger the variance of y is after a drive when so much of the matching noise is common.
double grownByWhatIsCommon(const World& world, const Wheels& wheels = {}, const OdometryNoise& noise = {}) {
  const SimulatedDrive drive(wheels, 11000, world);
  double variance[2];
  for (const bool common : {false, true}) {
    PipelineOptions options;
    options.reference.older_compared = 0;
    options.reference.matching_common = common ? 1.0 : 0.0;
    options.odometry_noise = noise;
    Driven driven(drive, options);
    driven.odometry(0);
    driven.run(0, 10000);
    variance[common ? 1 : 0] = driven.reports.back().estimate->covariance(1, 1);
  }
  return variance[1] / variance[0];
}

/// It is for what walls make a match err by, not for the noise of ranges, whose correlations are known.
TEST(ScanOdometry, WhatMatchesOneAfterTheOtherErrByAlikeAddsUp) {
  const double among_rough_walls = grownByWhatIsCommon(rough(room(), 0.08));
  const double among_smooth_walls = grownByWhatIsCommon(room());
  EXPECT_GT(among_rough_walls, 1.3);
  EXPECT_LT(among_rough_walls, 2.1);
  EXPECT_LT(among_smooth_walls, 1.2);
  EXPECT_GE(among_smooth_walls, 1.0);
}

/// What the estimate does not take over from a displacement it does not err by either.
TEST(ScanOdometry, WhatMatchesErrByDoesNotMatterWhereTheWheelsKnowBetter) {
  Wheels good;
  good.scale = 1.0;
  good.yaw_per_meter = 0.0;
  const double with_good_wheels = grownByWhatIsCommon(rough(room(), 0.08), good, {0.001, 0.001, 0.001, 0.001});
  EXPECT_GE(with_good_wheels, 1.0);
  EXPECT_LT(with_good_wheels, 1.1);
}

}  // namespace
}  // namespace sckf::test
