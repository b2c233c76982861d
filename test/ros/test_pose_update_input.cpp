#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "sckf_odometry/ros/conversions.h"
#include "sckf_odometry/ros/pose_update_input.h"

namespace sckf {
namespace {

using testing::ElementsAre;
using testing::Pair;

geometry_msgs::PoseWithCovarianceStamped pose() {
  geometry_msgs::PoseWithCovarianceStamped message =
      toPoseMessage(std::chrono::seconds(1000), SE2(1.0, 2.0, 0.5), 0.04 * Eigen::Matrix3d::Identity(), "/map");
  return message;
}

class PoseUpdateInputTest : public testing::Test {
 protected:
  PoseUpdateInputTest() {
    ros::Time::init();
    ros::Time::setNow(ros::Time(1000.0));
  }

  Warnings warnings_;
  Health health_{"/odom", {"/scan"}};
  PoseUpdateInput input_{NodeOptions(), "/pose_update", health_, warnings_};
};

TEST_F(PoseUpdateInputTest, APoseIsTaken) {
  const auto update = input_.admit(pose());
  ASSERT_TRUE(update);
  EXPECT_EQ(update->stamp, std::chrono::seconds(1000));
  EXPECT_LT(error(update->map_from_base.pose, SE2(1.0, 2.0, 0.5)).norm(), 1e-12);
  EXPECT_TRUE(update->map_from_base.covariance.isApprox(0.04 * Eigen::Matrix3d::Identity()));
  EXPECT_EQ(health_.pose_updates.received(), 1U);
}

TEST_F(PoseUpdateInputTest, WhatIsNoneIsRefusedAndCounted) {
  auto message = pose();
  message.header.frame_id = "odom";
  EXPECT_FALSE(input_.admit(message));
  message = pose();
  message.pose.pose.orientation.w = 0.0;
  EXPECT_FALSE(input_.admit(message));
  message = pose();
  message.pose.pose.position.x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(input_.admit(message));
  message = pose();
  message.pose.covariance[0] = -1.0;
  EXPECT_FALSE(input_.admit(message));
  message = pose();
  message.header.stamp = ros::Time();
  EXPECT_FALSE(input_.admit(message));
  for (const double none : {0.0, 1e-30}) {
    message = pose();
    message.pose.covariance[35] = none;
    EXPECT_FALSE(input_.admit(message)) << "a yaw that is known exactly";
  }
  EXPECT_THAT(health_.pose_updates.ends(), ElementsAre(Pair("refused, no covariance", 2U), Pair("refused, no pose", 4U),
                                                       Pair("refused, no stamp", 1U)));
}

TEST_F(PoseUpdateInputTest, WhatThePipelineMadeOfItIsCounted) {
  PoseReport report;
  report.in_map = MapEstimate();
  for (const PoseOutcome outcome : {PoseOutcome::kEntered, PoseOutcome::kUsed, PoseOutcome::kUsed,
                                    PoseOutcome::kContradicts, PoseOutcome::kTooLate, PoseOutcome::kNoOdometry}) {
    health_.poseUpdatePassed();
    report.outcome = outcome;
    input_.ended(report);
  }
  EXPECT_THAT(health_.pose_updates.ends(),
              ElementsAre(Pair("contradicts", 1U), Pair("entered", 1U), Pair("no odometry", 1U), Pair("too late", 1U),
                          Pair("used", 2U)));
}

}  // namespace
}  // namespace sckf
