#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "sckf_odometry/ros/conversions.h"
#include "sckf_odometry/ros/imu_input.h"
#include "text_matchers.h"

namespace sckf {
namespace {

using testing::ElementsAre;
using testing::Pair;

const double kNan = std::numeric_limits<double>::quiet_NaN();

geometry_msgs::Quaternion toMessage(const Eigen::Quaterniond& q) {
  geometry_msgs::Quaternion message;
  message.x = q.x();
  message.y = q.y();
  message.z = q.z();
  message.w = q.w();
  return message;
}

/// What an IMU of that mount says of a robot with a yaw and a yaw rate in the plane.
sensor_msgs::Imu imu(double time, double yaw, double yaw_rate, const Eigen::Quaterniond& base_from_imu) {
  sensor_msgs::Imu message;
  message.header.stamp = ros::Time(time);
  message.header.frame_id = "/imu_link";
  message.orientation = toMessage(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * base_from_imu);
  const Eigen::Vector3d w = base_from_imu.inverse() * Eigen::Vector3d(0.0, 0.0, yaw_rate);
  message.angular_velocity.x = w.x();
  message.angular_velocity.y = w.y();
  message.angular_velocity.z = w.z();
  return message;
}

class ImuInputTest : public testing::Test {
 protected:
  ImuInputTest() {
    ros::Time::init();
    ros::Time::setNow(ros::Time(1000.0));
    options_.gyro = options_.orientation = true;
  }

  void setMount(const Eigen::Quaterniond& base_from_imu) {
    geometry_msgs::TransformStamped transform;
    transform.header.frame_id = "base_link";
    transform.child_frame_id = "imu_link";
    transform.transform.rotation = toMessage(base_from_imu);
    tf2_msgs::TFMessage message;
    message.transforms.push_back(transform);
    tf_.add(message, true);
  }

  std::vector<ImuSample> admit(const sensor_msgs::Imu& message) {
    if (!input_) input_ = std::make_unique<ImuInput>(options_, "/imu", 1.0, health_, warnings_);
    return input_->admit(message, Stamp(0), tf_);
  }

  ImuOptions options_;
  Warnings warnings_;
  Health health_{"/odom", {"/scan"}};
  TfInput tf_{"base_link", "", std::chrono::seconds(1)};
  std::unique_ptr<ImuInput> input_;
};

TEST_F(ImuInputTest, ReadingsAreTurnedIntoBaseLinkHoweverItIsMounted) {
  for (const Eigen::Quaterniond& mount :
       {Eigen::Quaterniond::Identity(), Eigen::Quaterniond(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX())),
        Eigen::Quaterniond(Eigen::AngleAxisd(M_PI_2, Eigen::Vector3d(1.0, 2.0, 3.0).normalized()))}) {
    std::string problem;
    const auto sample = toImuSample(imu(1000.0, 2.5, 0.7, mount), Eigen::Isometry3d(mount), options_, &problem);
    ASSERT_TRUE(sample) << problem;
    EXPECT_EQ(sample->stamp, std::chrono::seconds(1000));
    EXPECT_NEAR(sample->yaw_rate.value(), 0.7, 1e-12);
    EXPECT_NEAR(sample->yaw.value(), 2.5, 1e-12);
  }
}

TEST_F(ImuInputTest, UntilItsMountIsKnownItIsRefusedByName) {
  EXPECT_TRUE(admit(imu(1000.0, 0.0, 0.0, Eigen::Quaterniond::Identity())).empty());
  EXPECT_TRUE(contains(input_->mountProblem(), "base_link -> imu_link"));
  setMount(Eigen::Quaterniond::Identity());
  EXPECT_EQ(admit(imu(1000.1, 0.0, 0.0, Eigen::Quaterniond::Identity())).size(), 1U);
  EXPECT_EQ(input_->mountProblem(), "");
  EXPECT_THAT(health_.imu.ends(), ElementsAre(Pair("refused, no mount", 1U)));
}

TEST_F(ImuInputTest, WhatIsNotMeasuredIsNotUsed) {
  std::string problem;
  sensor_msgs::Imu message = imu(1000.0, 0.3, 0.7, Eigen::Quaterniond::Identity());
  message.orientation_covariance[0] = -1.0;
  auto sample = toImuSample(message, Eigen::Isometry3d::Identity(), options_, &problem);
  ASSERT_TRUE(sample);
  EXPECT_TRUE(sample->yaw_rate);
  EXPECT_FALSE(sample->yaw);
  message.angular_velocity_covariance[0] = -1.0;
  EXPECT_FALSE(toImuSample(message, Eigen::Isometry3d::Identity(), options_, &problem));
  EXPECT_EQ(problem,
            "angular_velocity_covariance[0] is -1, which says that it is not measured; orientation_covariance[0] is "
            "-1, which says that it is not measured");
  message.orientation_covariance[0] = 0.0;
  sample = toImuSample(message, Eigen::Isometry3d::Identity(), options_, &problem);
  ASSERT_TRUE(sample);
  EXPECT_FALSE(sample->yaw_rate);
  EXPECT_TRUE(sample->yaw);
}

TEST_F(ImuInputTest, WhatIsNotAskedForIsNotLookedAt) {
  std::string problem;
  sensor_msgs::Imu message = imu(1000.0, 0.3, 0.7, Eigen::Quaterniond::Identity());
  message.orientation = geometry_msgs::Quaternion();  // as drivers leave it
  options_.orientation = false;
  const auto sample = toImuSample(message, Eigen::Isometry3d::Identity(), options_, &problem);
  ASSERT_TRUE(sample) << problem;
  EXPECT_FALSE(sample->yaw);
}

TEST_F(ImuInputTest, WhatIsNoReadingIsRefusedWithItsValue) {
  std::string problem;
  sensor_msgs::Imu message = imu(1000.0, 0.3, 0.7, Eigen::Quaterniond::Identity());
  message.angular_velocity.z = kNan;
  message.orientation.w = 3.0;
  EXPECT_FALSE(toImuSample(message, Eigen::Isometry3d::Identity(), options_, &problem));
  EXPECT_TRUE(contains(problem, "angular_velocity (0, 0, nan): finite numbers expected"));
  EXPECT_TRUE(contains(problem, "a quaternion of length 1 expected"));
  setMount(Eigen::Quaterniond::Identity());
  EXPECT_TRUE(admit(message).empty());
  message.header.stamp = ros::Time();
  EXPECT_TRUE(admit(message).empty());
  message.header.stamp = ros::Time(1000.0);
  message.header.frame_id = "";
  EXPECT_TRUE(admit(message).empty());
  EXPECT_THAT(health_.imu.ends(), ElementsAre(Pair("refused, no frame", 1U), Pair("refused, no reading", 1U),
                                              Pair("refused, no stamp", 1U)));
}

TEST_F(ImuInputTest, AWrongStampIsHeldBackAndCounted) {
  setMount(Eigen::Quaterniond::Identity());
  const auto at = [](double time) { return imu(time, 0.0, 0.0, Eigen::Quaterniond::Identity()); };
  EXPECT_EQ(admit(at(1000.0)).size(), 1U);
  EXPECT_TRUE(admit(at(500.0)).empty());
  EXPECT_EQ(input_->heldBack(), 1U);
  EXPECT_EQ(admit(at(1000.1)).size(), 1U);
  EXPECT_THAT(health_.imu.ends(), ElementsAre(Pair("refused, wrong stamp", 1U)));
}

TEST_F(ImuInputTest, WhatThePipelineMadeOfItIsCounted) {
  admit(imu(1000.0, 0.0, 0.0, Eigen::Quaterniond::Identity()));
  for (const auto insertion : {ImuBuffer::Insertion::kInserted, ImuBuffer::Insertion::kDuplicate,
                               ImuBuffer::Insertion::kTooOld, ImuBuffer::Insertion::kNotFinite}) {
    input_->ended(insertion, std::chrono::seconds(1000), std::chrono::milliseconds(1000500));
  }
  EXPECT_THAT(health_.imu.ends(),
              ElementsAre(Pair("refused, duplicate", 1U), Pair("refused, no mount", 1U),
                          Pair("refused, no reading", 1U), Pair("refused, too late", 1U), Pair("used", 1U)));
}

TEST_F(ImuInputTest, WhyThePipelineRefusedItIsSaidWithTheStamps) {
  input_ = std::make_unique<ImuInput>(options_, "/imu", 1.0, health_, warnings_);
  const Stamp stamp = std::chrono::seconds(1000);
  input_->ended(ImuBuffer::Insertion::kDuplicate, stamp, stamp);
  EXPECT_EQ(health_.imu.lastRefusal(), "header.stamp is 1000.000000000: there is one of that stamp already");
  const std::string late = "it came after a scan that was taken later: header.stamp is 1000.000000000, ";
  input_->ended(ImuBuffer::Insertion::kTooOld, stamp, stamp + std::chrono::milliseconds(100));
  EXPECT_EQ(health_.imu.lastRefusal(), late + "0.1 s before the newest odometry, 1000.100000000");
  input_->ended(ImuBuffer::Insertion::kTooOld, stamp, stamp + std::chrono::seconds(3));
  EXPECT_EQ(health_.imu.lastRefusal(),
            late + "3 s before the newest odometry, 1003.000000000: are the clocks synchronised?");
}

}  // namespace
}  // namespace sckf
