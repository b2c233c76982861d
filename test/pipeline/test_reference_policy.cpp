#include <gtest/gtest.h>

#include "sckf_odometry/pipeline/reference_policy.h"

namespace sckf {
namespace {

constexpr double kGoodOverlap = 0.9;

/// Limits that no test of one of them meets by accident with another.
ReferenceOptions limits() {
  ReferenceOptions options;
  options.kf_dist_linear = 1.0;
  options.kf_dist_angular = 0.5;
  options.kf_min_overlap = 0.6;
  return options;
}

TEST(ReferencePolicy, KeepsTheReferenceWhileTheRobotIsNear) {
  ReferencePolicy policy(limits());
  for (int i = 0; i < 100; ++i) {
    EXPECT_FALSE(policy.replaces(SE2(0.4, 0.1 * (i % 2), 0.1), kGoodOverlap, true)) << i;
  }
}

/// At 0.3 m per scan the scan at 0.9 m becomes the reference: the next one would be at 1.2 m, beyond the limit.
TEST(ReferencePolicy, LooksAheadByTheLastStep) {
  ReferencePolicy policy(limits());
  EXPECT_FALSE(policy.replaces(SE2(0.3, 0, 0), kGoodOverlap, true));
  EXPECT_FALSE(policy.replaces(SE2(0.6, 0, 0), kGoodOverlap, true));
  EXPECT_TRUE(policy.replaces(SE2(0.9, 0, 0), kGoodOverlap, true));
}

TEST(ReferencePolicy, TheWayCountsInAnyDirection) {
  for (const SE2& step : {SE2(-0.6, 0, 0), SE2(0, 0.6, 0), SE2(0, -0.6, 0), SE2(0.45, -0.45, 0)}) {
    EXPECT_TRUE(ReferencePolicy(limits()).replaces(step, kGoodOverlap, true)) << step.vector().transpose();
  }
  EXPECT_FALSE(ReferencePolicy(limits()).replaces(SE2(0.3, 0.3, 0), kGoodOverlap, true));
}

TEST(ReferencePolicy, AnyRotationCounts) {
  for (const double sign : {1.0, -1.0}) {
    ReferencePolicy policy(limits());
    EXPECT_FALSE(policy.replaces(SE2(0, 0, sign * 0.2), kGoodOverlap, true));
    EXPECT_TRUE(policy.replaces(SE2(0, 0, sign * 0.4), kGoodOverlap, true));
  }
}

TEST(ReferencePolicy, ExactlyAtTheLimitItIsKept) {
  EXPECT_FALSE(ReferencePolicy(limits()).replaces(SE2(0.5, 0, 0), kGoodOverlap, true));
  EXPECT_FALSE(ReferencePolicy(limits()).replaces(SE2(0, 0, 0.25), kGoodOverlap, true));
  EXPECT_TRUE(ReferencePolicy(limits()).replaces(SE2(0.501, 0, 0), kGoodOverlap, true));
  EXPECT_TRUE(ReferencePolicy(limits()).replaces(SE2(0, 0, 0.251), kGoodOverlap, true));
}

TEST(ReferencePolicy, TheStepBeginsAnewAtANewReference) {
  ReferencePolicy policy(limits());
  EXPECT_TRUE(policy.replaces(SE2(0.9, 0, 0), kGoodOverlap, true));
  // From the new reference: a step of 0.4 m, not one back by 1.3 m.
  EXPECT_FALSE(policy.replaces(SE2(-0.4, 0, 0), kGoodOverlap, true));
}

/// Among trees hardly a half of the points has a partner in the next scan, too: what counts is how much less it
/// becomes.
TEST(ReferencePolicy, ReplacesWhereScansOverlapMuchLessThanTheyDid) {
  for (const double most : {1.0, 0.5}) {
    ReferencePolicy policy(limits());
    EXPECT_FALSE(policy.replaces(SE2(), 0.8 * most, true)) << most;
    EXPECT_FALSE(policy.replaces(SE2(), most, true)) << most << ": the largest need not be the first";
    EXPECT_FALSE(policy.replaces(SE2(), 0.61 * most, true)) << most;
    EXPECT_TRUE(policy.replaces(SE2(), 0.59 * most, true)) << most;
  }
}

TEST(ReferencePolicy, TheLargestOverlapBeginsAnewAtANewReference) {
  ReferencePolicy policy(limits());
  EXPECT_FALSE(policy.replaces(SE2(), 1.0, true));
  EXPECT_TRUE(policy.replaces(SE2(), 0.5, true));
  EXPECT_FALSE(policy.replaces(SE2(), 0.5, true)) << "the most that has been seen of this one";
}

/// If the robot is not where the wheels say, the next scan is nearer to this one.
TEST(ReferencePolicy, AScanThatWasNotUsedReplacesAtOnce) {
  ReferencePolicy policy(limits());
  for (int i = 0; i < 3; ++i) {
    EXPECT_TRUE(policy.replaces(SE2(), kGoodOverlap, false)) << i;
    EXPECT_FALSE(policy.replaces(SE2(0.4, 0, 0), kGoodOverlap, true)) << i << ": the step begins anew there";
  }
}

/// The algorithm of the paper: every scan is the next one's reference, as long as the robot moves at all.
TEST(ReferencePolicy, ZeroDistancesMakeEveryScanAReference) {
  ReferenceOptions options = limits();
  options.kf_dist_linear = 0.0;
  options.kf_dist_angular = 0.0;
  ReferencePolicy policy(options);
  for (const SE2& step : {SE2(1e-3, 0, 0), SE2(0, -1e-6, 0), SE2(0, 0, 1e-6), SE2(0.5, 0.1, 0.1)}) {
    EXPECT_TRUE(policy.replaces(step, kGoodOverlap, true)) << step.vector().transpose();
  }
}

}  // namespace
}  // namespace sckf
