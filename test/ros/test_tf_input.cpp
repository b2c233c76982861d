#include <gtest/gtest.h>

#include "sckf_odometry/ros/conversions.h"
#include "sckf_odometry/ros/tf_input.h"
#include "text_matchers.h"
#include "transforms.h"

namespace sckf::test {
namespace {

constexpr Stamp kJump = std::chrono::seconds(1);

Stamp at(double time) { return toStamp(ros::Time(time)); }

TEST(TfInput, AMountIsKnownWhenTfHasToldIt) {
  TfInput tf("base_link", "", kJump);
  std::string problem;
  EXPECT_FALSE(tf.baseFrom("laser", &problem));
  EXPECT_TRUE(contains(problem, "laser"));
  tf.add(transform("base_link", "plate", 5.0, SE2(1.0, 0.0, 0.0)), false);
  EXPECT_FALSE(tf.baseFrom("laser", &problem));
  tf.add(transform("plate", "laser", 3.0, SE2(0.0, 2.0, 0.5)), true);
  const auto mount = tf.baseFrom("laser", &problem);
  ASSERT_TRUE(mount);
  EXPECT_NEAR(error(toPlanar(*mount), SE2(1.0, 2.0, 0.5)).norm(), 0.0, 1e-12);
}

TEST(TfInput, AMountIsLookedUpOnceAndAgainWhenItIsForgotten) {
  TfInput tf("base_link", "", kJump);
  tf.add(transform("base_link", "laser", 0.0, SE2(1.0, 0.0, 0.0)), true);
  EXPECT_EQ(tf.baseFrom("laser", nullptr)->translation().x(), 1.0);
  tf.add(transform("base_link", "laser", 0.0, SE2(2.0, 0.0, 0.0)), true);
  EXPECT_EQ(tf.baseFrom("laser", nullptr)->translation().x(), 1.0);
  tf.forgetMounts();
  EXPECT_EQ(tf.baseFrom("laser", nullptr)->translation().x(), 2.0);
}

TEST(TfInput, AScanInTheFrameOfTheRobotNeedsNoTransform) {
  TfInput tf("base_link", "", kJump);
  EXPECT_TRUE(tf.baseFrom("base_link", nullptr)->isApprox(Eigen::Isometry3d::Identity()));
}

TEST(TfInput, LeadingSlashesMakeNoDifference) {
  TfInput tf("base_link", "odom", kJump);
  tf.add(transform("/base_link", "/laser", 0.0, SE2(1.0, 0.0, 0.0)), true);
  EXPECT_TRUE(tf.baseFrom("laser", nullptr));
  tf.add(transform("/odom", "/base_link", 1.0, SE2()), false);
  EXPECT_EQ(tf.takeOdometry().size(), 1u);
}

TEST(TfInput, OdometryIsTakenOnceAtItsStamps) {
  TfInput tf("base_link", "odom", kJump);
  tf.add(transform("odom", "base_link", 1.0, SE2(0.1, 0.0, 0.0)), false);
  tf.add(transform("odom", "base_link", 1.1, SE2(0.2, 0.0, 0.3)), false);
  tf.add(transform("odom", "base_link", 1.1, SE2(0.2, 0.0, 0.3)), false);
  const auto samples = tf.takeOdometry();
  ASSERT_EQ(samples.size(), 2u);
  EXPECT_EQ(samples[0].stamp, at(1.0));
  EXPECT_EQ(samples[1].stamp, at(1.1));
  EXPECT_NEAR(error(samples[1].odom_from_base, SE2(0.2, 0.0, 0.3)).norm(), 0.0, 1e-12);
  EXPECT_FALSE(samples[1].twist_covariance);
  EXPECT_TRUE(tf.takeOdometry().empty());
}

TEST(TfInput, OdometryWaitsForTheRestOfItsChain) {
  TfInput tf("base_link", "odom", kJump);
  tf.add(transform("odom", "base_footprint", 1.0, SE2(1.0, 0.0, 0.0)), false);
  tf.add(transform("odom", "base_footprint", 1.1, SE2(2.0, 0.0, 0.0)), false);
  EXPECT_TRUE(tf.takeOdometry().empty());
  EXPECT_TRUE(contains(tf.odometryProblem(), "base_link"));
  // Before 1.05 the chain is never known; that is forgotten.
  tf.add(transform("base_footprint", "base_link", 1.05, SE2(0.0, 0.5, 0.0)), false);
  tf.add(transform("base_footprint", "base_link", 1.15, SE2(0.0, 0.5, 0.0)), false);
  const auto samples = tf.takeOdometry();
  ASSERT_EQ(samples.size(), 1u);
  EXPECT_EQ(samples[0].stamp, at(1.1));
  EXPECT_NEAR(error(samples[0].odom_from_base, SE2(2.0, 0.5, 0.0)).norm(), 0.0, 1e-12);
  EXPECT_TRUE(tf.odometryProblem().empty());
}

TEST(TfInput, WhatKeepsOdometryFromBeingToldIsSaidOnceHoweverOftenItIsAskedFor) {
  TfInput tf("base_footprint", "odom", kJump);
  for (int i = 0; i < 100; ++i) {
    tf.add(transform("odom", "base_link", 1.0 + 0.1 * i, SE2()), false);
    EXPECT_TRUE(tf.takeOdometry().empty());
  }
  EXPECT_TRUE(contains(tf.odometryProblem(), "base_footprint"));
  EXPECT_LT(tf.odometryProblem().size(), 300u) << tf.odometryProblem();
}

TEST(TfInput, TimeThatGoesBackForGoodIsFollowed) {
  TfInput tf("base_link", "odom", kJump);
  for (int i = 0; i < 10; ++i) tf.add(transform("odom", "base_link", 100.0 + i, SE2(i, 0.0, 0.0)), false);
  EXPECT_EQ(tf.takeOdometry().size(), 10u);
  for (int i = 0; i < 5; ++i) tf.add(transform("odom", "base_link", 50.0 + 0.1 * i, SE2(i, 0.0, 0.0)), false);
  const auto samples = tf.takeOdometry();
  ASSERT_EQ(samples.size(), 3u);  // the first two might have been stray
  EXPECT_EQ(samples.back().stamp, at(50.4));
}

TEST(TfInput, AStrayTransformOfLongAgoChangesNothing) {
  TfInput tf("base_link", "odom", kJump);
  tf.add(transform("odom", "base_link", 100.0, SE2()), false);
  tf.add(transform("odom", "base_link", 50.0, SE2(9.0, 9.0, 0.0)), false);
  tf.add(transform("odom", "base_link", 100.1, SE2(1.0, 0.0, 0.0)), false);
  const auto samples = tf.takeOdometry();
  ASSERT_EQ(samples.size(), 2u);
  EXPECT_EQ(samples[1].stamp, at(100.1));
}

TEST(TfInput, OdometryOfAnotherFrameOfTheRobotIsMovedOrRefused) {
  TfInput tf("base_link", "", kJump);
  OdometrySample sample;
  sample.odom_from_base = SE2(1.0, 0.0, M_PI / 2);
  std::string problem;
  EXPECT_TRUE(tf.inBaseFrame(sample, "", &problem));
  EXPECT_TRUE(tf.inBaseFrame(sample, "base_link", &problem));
  EXPECT_FALSE(tf.inBaseFrame(sample, "axle", &problem));
  EXPECT_TRUE(contains(problem, "child_frame_id is \"axle\", ~base_frame \"base_link\" expected"));
  tf.add(transform("base_link", "axle", 0.0, SE2(-0.2, 0.0, 0.0)), true);
  const auto moved = tf.inBaseFrame(sample, "axle", &problem);
  ASSERT_TRUE(moved);
  EXPECT_NEAR(error(moved->odom_from_base, SE2(1.0, 0.2, M_PI / 2)).norm(), 0.0, 1e-12);
}

}  // namespace
}  // namespace sckf::test
