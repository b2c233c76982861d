#include <gmock/gmock.h>
#include <sensor_msgs/point_cloud2_iterator.h>

#include "sckf_odometry/ros/conversions.h"
#include "sckf_odometry/ros/input_gate.h"

namespace sckf {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

class InputGateTest : public testing::Test {
 protected:
  InputGateTest() {
    ros::Time::init();
    ros::Time::setNow(ros::Time(1000.0));
  }

  static nav_msgs::Odometry odometryAt(double time) {
    nav_msgs::Odometry message;
    message.header.stamp = ros::Time(time);
    message.child_frame_id = "base_link";
    message.pose.pose.orientation.w = 1.0;
    return message;
  }

  /// One point.
  static sensor_msgs::PointCloud2 cloudAt(double time) {
    sensor_msgs::PointCloud2 message;
    sensor_msgs::PointCloud2Modifier(message).setPointCloud2FieldsByString(1, "xyz");
    sensor_msgs::PointCloud2Modifier(message).resize(1);
    message.header.stamp = ros::Time(time);
    message.header.frame_id = "lidar";
    return message;
  }

  static sensor_msgs::LaserScan scanAt(double time) {
    sensor_msgs::LaserScan message;
    message.header.stamp = ros::Time(time);
    message.header.frame_id = "laser";
    message.angle_min = -1.0F;
    message.angle_max = 1.0F;
    message.angle_increment = 0.1F;
    return message;
  }

  std::size_t admit(const sensor_msgs::LaserScan& message) {
    return gate_.admit(boost::make_shared<sensor_msgs::LaserScan>(message)).passed.size();
  }
  std::size_t admit(const sensor_msgs::PointCloud2& message) {
    return gate_.admit(boost::make_shared<sensor_msgs::PointCloud2>(message)).passed.size();
  }
  std::size_t admit(const nav_msgs::Odometry& message, bool uses_twist_covariance = false) {
    return gate_.admit(message, uses_twist_covariance, tf_).passed.size();
  }

  Health health_{"/odom", {"/scan"}};
  Warnings warnings_;
  TfInput tf_{"base_link", "", std::chrono::seconds(1)};
  InputGate gate_{NodeOptions(), "/odom", {"/scan"}, health_, warnings_};
};

TEST_F(InputGateTest, WhatIsAsItShouldBePassesAndHasNotEnded) {
  EXPECT_EQ(admit(odometryAt(1000.0)), 1u);
  EXPECT_EQ(admit(scanAt(1000.0)), 1u);
  EXPECT_EQ(health_.odometry.received(), 1u);
  EXPECT_EQ(health_.scans.received(), 1u);
  EXPECT_THAT(health_.odometry.ends(), IsEmpty());
  EXPECT_THAT(health_.scans.ends(), IsEmpty());
  EXPECT_EQ(gate_.newestOdometry(), toStamp(ros::Time(1000.0)));
}

TEST_F(InputGateTest, ABadScanIsRefusedByWhatIsWrongWithIt) {
  EXPECT_EQ(admit(scanAt(0.0)), 0u);
  sensor_msgs::LaserScan scan = scanAt(1000.0);
  scan.header.frame_id = "";
  EXPECT_EQ(admit(scan), 0u);
  scan = scanAt(1000.0);
  scan.angle_increment = -0.1F;
  EXPECT_EQ(admit(scan), 0u);
  EXPECT_EQ(health_.scans.received(), 3u);
  EXPECT_THAT(health_.scans.ends(), ElementsAre(Pair("refused, angles turned round", 1u), Pair("refused, no frame", 1u),
                                                Pair("refused, no stamp", 1u)));
}

TEST_F(InputGateTest, ABadCloudIsRefusedByWhatIsWrongWithIt) {
  EXPECT_EQ(admit(cloudAt(1000.0)), 1u);
  EXPECT_EQ(admit(cloudAt(0.0)), 0u);
  sensor_msgs::PointCloud2 cloud = cloudAt(1000.1);
  cloud.header.frame_id = "";
  EXPECT_EQ(admit(cloud), 0u);
  cloud = cloudAt(1000.1);
  cloud.fields.pop_back();
  EXPECT_EQ(admit(cloud), 0u);
  EXPECT_EQ(health_.scans.received(), 4u);
  EXPECT_THAT(health_.scans.ends(), ElementsAre(Pair("refused, bad cloud", 1u), Pair("refused, no frame", 1u),
                                                Pair("refused, no stamp", 1u)));
}

TEST_F(InputGateTest, CloudsAreInTheRowOfStampsOfScans) {
  EXPECT_EQ(admit(cloudAt(1000.0)), 1u);
  EXPECT_EQ(admit(cloudAt(500.0)), 0u);
  EXPECT_EQ(gate_.scansHeldBack(), 1u);
  EXPECT_EQ(admit(cloudAt(1000.1)), 1u);
  EXPECT_THAT(health_.scans.ends(), ElementsAre(Pair("refused, wrong stamp", 1u)));
}

TEST_F(InputGateTest, BadOdometryIsRefusedByWhatIsWrongWithIt) {
  EXPECT_EQ(admit(odometryAt(0.0)), 0u);
  nav_msgs::Odometry odometry = odometryAt(1000.0);
  odometry.pose.pose.orientation.w = 0.0;
  EXPECT_EQ(admit(odometry), 0u);
  odometry = odometryAt(1000.0);
  odometry.child_frame_id = "wheel";
  EXPECT_EQ(admit(odometry), 0u);
  EXPECT_EQ(health_.odometry.received(), 3u);
  EXPECT_THAT(health_.odometry.ends(), ElementsAre(Pair("refused, no pose", 1u), Pair("refused, no stamp", 1u),
                                                   Pair("refused, other frame", 1u)));
}

TEST_F(InputGateTest, ABadTwistCovarianceIsNoReasonToRefuseOdometry) {
  nav_msgs::Odometry odometry = odometryAt(1000.0);
  odometry.twist.covariance[0] = -1.0;
  EXPECT_EQ(admit(odometry, true), 1u);
}

TEST_F(InputGateTest, AWrongStampIsHeldBackAndCountedWhenTheNextGoesOn) {
  EXPECT_EQ(admit(odometryAt(1000.0)), 1u);
  EXPECT_EQ(admit(odometryAt(500.0)), 0u);
  EXPECT_EQ(gate_.odometryHeldBack(), 1u);
  EXPECT_EQ(admit(odometryAt(1000.1)), 1u);
  EXPECT_EQ(gate_.odometryHeldBack(), 0u);
  EXPECT_THAT(health_.odometry.ends(), ElementsAre(Pair("refused, wrong stamp", 1u)));
  EXPECT_EQ(admit(scanAt(1000.0)), 1u);
  EXPECT_EQ(admit(scanAt(500.0)), 0u);
  EXPECT_EQ(gate_.scansHeldBack(), 1u);
  EXPECT_EQ(admit(scanAt(1000.1)), 1u);
  EXPECT_THAT(health_.scans.ends(), ElementsAre(Pair("refused, wrong stamp", 1u)));
}

TEST_F(InputGateTest, LasersHaveTimesOfTheirOwn) {
  Health health("/odom", {"/front", "/rear"});
  InputGate gate(NodeOptions(), "/odom", {"/front", "/rear"}, health, warnings_);
  const auto admitted = [&](std::size_t laser, double time) {
    return gate.admit(boost::make_shared<sensor_msgs::LaserScan>(scanAt(time)), laser).passed.size();
  };
  EXPECT_EQ(admitted(0, 1000.0), 1u);
  EXPECT_EQ(admitted(1, 990.0), 1u) << "the first of a slow one";
  EXPECT_EQ(admitted(0, 900.0), 0u);
  EXPECT_EQ(gate.scansHeldBack(), 1u);
  EXPECT_EQ(admitted(1, 990.5), 1u) << "whatever the other says";
}

TEST_F(InputGateTest, ScansAheadOfTheClockPassIfOdometryIsThereToo) {
  admit(odometryAt(1000.0));
  admit(scanAt(1000.0));
  EXPECT_EQ(admit(scanAt(1005.0)), 0u);  // ahead of the clock, and of the odometry
  EXPECT_EQ(gate_.scansHeldBack(), 1u);
  ros::Time::setNow(ros::Time(1005.0));
  EXPECT_EQ(admit(odometryAt(1005.0)), 1u);
  ros::Time::setNow(ros::Time(1000.0));
  EXPECT_EQ(admit(scanAt(1005.1)), 2u) << "and the one that was held back goes on from it";
}

TEST_F(InputGateTest, WhereOdometryTellsThatTimeWentBackScansFollowAtOnce) {
  admit(odometryAt(1000.0));
  admit(scanAt(1000.0));
  std::size_t passed = 0;
  for (const double time : {500.0, 500.1, 500.2}) passed += admit(odometryAt(time));
  EXPECT_EQ(passed, 3u);
  gate_.restart();
  EXPECT_EQ(admit(scanAt(500.2)), 1u);
}

}  // namespace
}  // namespace sckf
