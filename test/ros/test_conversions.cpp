#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/matrix_matchers.h"
#include "sckf_odometry/ros/conversions.h"
#include "text_matchers.h"

namespace sckf {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

nav_msgs::Odometry odometryAt(double x, double y, double yaw) {
  nav_msgs::Odometry message;
  message.header.stamp = ros::Time(12, 345678901);
  message.pose.pose.position.x = x;
  message.pose.pose.position.y = y;
  message.pose.pose.orientation.z = std::sin(yaw / 2);
  message.pose.pose.orientation.w = std::cos(yaw / 2);
  return message;
}

std::string problemOf(const nav_msgs::Odometry& message) {
  std::string problem;
  EXPECT_FALSE(toOdometrySample(message, &problem));
  return problem;
}

TEST(Conversions, StampsKeepEveryNanosecond) {
  const ros::Time time(1438050934, 400468801);
  EXPECT_EQ(toStamp(time).count(), 1438050934400468801);
  EXPECT_EQ(toTime(toStamp(time)), time);
}

TEST(Conversions, FrameNamesLoseTheirLeadingSlash) {
  EXPECT_EQ(frameName("/camera_depth_frame"), "camera_depth_frame");
  EXPECT_EQ(frameName("robot1/laser"), "robot1/laser");
  EXPECT_EQ(frameName(""), "");
}

TEST(Conversions, AScanKeepsItsBeamsWhateverAngleMaxSays) {
  sensor_msgs::LaserScan message;
  message.header.stamp = ros::Time(3, 5);
  message.angle_min = -0.5F;
  message.angle_increment = 0.25F;
  message.angle_max = 99.0F;
  message.range_min = 0.125F;
  message.range_max = 30.0F;
  message.ranges = {1.0F, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()};
  const LaserScan scan = toScan(message);
  EXPECT_EQ(scan.stamp, toStamp(message.header.stamp));
  EXPECT_EQ(scan.angle_min, -0.5);
  EXPECT_EQ(scan.angle_increment, 0.25);
  EXPECT_EQ(scan.range_min, 0.125);
  EXPECT_EQ(scan.range_max, 30.0);
  ASSERT_EQ(scan.ranges.size(), 3u);
  EXPECT_TRUE(std::isnan(scan.ranges[1]));
}

TEST(Conversions, OdometryBecomesASample) {
  const auto sample = toOdometrySample(odometryAt(1.5, -2.5, -3.0), nullptr);
  ASSERT_TRUE(sample);
  EXPECT_EQ(sample->stamp.count(), 12345678901);
  EXPECT_NEAR(error(sample->odom_from_base, SE2(1.5, -2.5, -3.0)).norm(), 0.0, 1e-12);
}

TEST(Conversions, TheHeadingOfATiltedPoseIsThatOfItsXAxis) {
  const Eigen::Quaterniond q = Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()) *
                               Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()) *
                               Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX());
  nav_msgs::Odometry message = odometryAt(0.0, 0.0, 0.0);
  message.pose.pose.orientation.x = q.x();
  message.pose.pose.orientation.y = q.y();
  message.pose.pose.orientation.z = q.z();
  message.pose.pose.orientation.w = q.w();
  EXPECT_NEAR(toOdometrySample(message, nullptr)->odom_from_base.yaw, 0.7, 1e-12);
}

TEST(Conversions, OdometryThatIsNotAPoseIsRefusedWithItsValue) {
  nav_msgs::Odometry message = odometryAt(kNaN, 0.0, 0.0);
  EXPECT_TRUE(contains(problemOf(message), "position (nan, 0): finite numbers expected"));
  message = odometryAt(0.0, std::numeric_limits<double>::infinity(), 0.0);
  EXPECT_TRUE(contains(problemOf(message), "position (0, inf)"));
  message = odometryAt(0.0, 0.0, 0.0);
  message.pose.pose.orientation.w = 0.0;
  EXPECT_TRUE(contains(problemOf(message), "orientation (0, 0, 0, 0): a quaternion of length 1 expected"));
  message.pose.pose.orientation.w = 1.1;
  EXPECT_TRUE(contains(problemOf(message), "orientation (0, 0, 0, 1.1)"));
  message.pose.pose.orientation.w = kNaN;
  EXPECT_TRUE(contains(problemOf(message), "orientation (0, 0, 0, nan)"));
}

TEST(Conversions, AQuaternionThatIsOnlyRoundedIsTaken) {
  nav_msgs::Odometry message = odometryAt(0.0, 0.0, 1.0);
  message.pose.pose.orientation.z *= 1.001;
  message.pose.pose.orientation.w *= 1.001;
  EXPECT_NEAR(toOdometrySample(message, nullptr)->odom_from_base.yaw, 1.0, 1e-12);
}

TEST(Conversions, TheTwistCovarianceIsThatOfTheThreeAxesOfThePlane) {
  nav_msgs::Odometry message = odometryAt(0.0, 0.0, 0.0);
  for (std::size_t i = 0; i < 36; ++i) message.twist.covariance[i] = static_cast<double>(i);
  Eigen::Matrix3d expected;
  expected << 0, 1, 5, 6, 7, 11, 30, 31, 35;  // rows and columns x, y, yaw of the 6 × 6
  EXPECT_EQ(*toOdometrySample(message, nullptr)->twist_covariance, expected);
  message.twist.covariance[7] = kNaN;
  EXPECT_FALSE(toOdometrySample(message, nullptr)->twist_covariance);
}

TEST(Conversions, OdometryOfAnotherFrameOfTheRobotIsMoved) {
  const SE2 child_from_base(-0.3, 0.1, 0.5);
  OdometrySample sample;
  sample.odom_from_base = SE2(1.0, 2.0, 0.7);
  sample.twist_covariance = Eigen::Vector3d(0.01, 0.02, 0.03).asDiagonal().toDenseMatrix();
  const OdometrySample result = moved(sample, child_from_base);
  EXPECT_NEAR(error(result.odom_from_base, compose(sample.odom_from_base, child_from_base)).norm(), 0.0, 1e-12);

  // The twist of base by that of child, differentiated: the motions of both over a short time.
  const double dt = 1e-6;
  Eigen::Matrix3d J_base_child;
  for (int i = 0; i < 3; ++i) {
    const SE2 child_motion(Eigen::Vector3d(dt * Eigen::Vector3d::Unit(i)));
    const SE2 base_motion = compose(inverse(child_from_base), compose(child_motion, child_from_base));
    J_base_child.col(i) = base_motion.vector() / dt;
  }
  const Eigen::Matrix3d expected = J_base_child * *sample.twist_covariance * J_base_child.transpose();
  EXPECT_LT((*result.twist_covariance - expected).norm(), 1e-6);
}

TEST(Conversions, AnEstimateBecomesOdometryWithItsWholeCovariance) {
  Estimate estimate;
  estimate.stamp = Stamp(7000000001);
  estimate.odom_from_base = SE2(1.0, 2.0, 2.5);
  estimate.covariance << 4, 1, 0.5, 1, 3, 0.2, 0.5, 0.2, 2;
  estimate.twist.mean = {0.5, -0.1, 0.3};
  estimate.twist.covariance = Eigen::Vector3d(0.1, 0.2, 0.3).asDiagonal();
  const nav_msgs::Odometry message = toOdometryMessage(estimate, "odom", "base_link");
  EXPECT_EQ(message.header.frame_id, "odom");
  EXPECT_EQ(message.child_frame_id, "base_link");
  EXPECT_EQ(message.header.stamp, ros::Time(7, 1));
  EXPECT_EQ(message.twist.twist.linear.x, 0.5);
  EXPECT_EQ(message.twist.twist.linear.y, -0.1);
  EXPECT_EQ(message.twist.twist.angular.z, 0.3);

  using Covariance = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
  const Covariance covariance = Eigen::Map<const Covariance>(message.pose.covariance.data());
  const auto x = 0, y = 1, yaw = 5;
  EXPECT_EQ(covariance(x, x), 4.0);
  EXPECT_EQ(covariance(x, y), 1.0);
  EXPECT_EQ(covariance(x, yaw), 0.5);
  EXPECT_EQ(covariance(y, yaw), 0.2);
  EXPECT_EQ(covariance(yaw, yaw), 2.0);
  EXPECT_EQ(covariance(2, 2), kVarianceOutOfPlane);
  EXPECT_EQ(covariance, covariance.transpose());
  EXPECT_GT(smallestEigenvalue(covariance), 0.0);

  const auto back = toOdometrySample(message, nullptr);
  ASSERT_TRUE(back);
  EXPECT_NEAR(error(back->odom_from_base, estimate.odom_from_base).norm(), 0.0, 1e-12);
  EXPECT_EQ(*back->twist_covariance, estimate.twist.covariance);
}

TEST(Conversions, TransformsAndPosesSayTheSame) {
  Estimate estimate;
  estimate.stamp = Stamp(1500000000);
  estimate.odom_from_base = SE2(-1.0, 4.0, -2.0);
  const auto transform = toTransform(estimate.odom_from_base, estimate.stamp, "odom", "base_link");
  EXPECT_EQ(transform.header.frame_id, "odom");
  EXPECT_EQ(transform.child_frame_id, "base_link");
  EXPECT_NEAR(error(*toPlanar(transform.transform, nullptr), estimate.odom_from_base).norm(), 0.0, 1e-12);
  const auto pose = toPoseMessage(estimate.stamp, estimate.odom_from_base, estimate.covariance, "odom");
  EXPECT_EQ(pose.header.stamp, transform.header.stamp);
  EXPECT_NEAR(error(*toPlanar(pose.pose.pose, nullptr), estimate.odom_from_base).norm(), 0.0, 1e-12);
}

TEST(Conversions, AnUpsideDownMountKeepsItsThirdDimension) {
  geometry_msgs::Transform transform;
  transform.translation.x = 0.2;
  transform.translation.z = 0.4;
  transform.rotation.x = 1.0;  // half a turn about x
  const Eigen::Isometry3d base_from_laser = toIsometry(transform);
  EXPECT_LT((base_from_laser * Eigen::Vector3d(1.0, 2.0, 0.0) - Eigen::Vector3d(1.2, -2.0, 0.4)).norm(), 1e-12);
}

TEST(Conversions, AScanWhoseLastAngleIsOnTheWrongSideIsTurnedRound) {
  sensor_msgs::LaserScan scan;
  scan.angle_min = -1.0F;
  scan.angle_max = 1.0F;
  scan.angle_increment = 0.1F;
  EXPECT_FALSE(isTurnedRound(scan));
  scan.angle_increment = -0.1F;
  EXPECT_TRUE(isTurnedRound(scan));
  std::swap(scan.angle_min, scan.angle_max);
  EXPECT_FALSE(isTurnedRound(scan));
  scan.angle_max = std::numeric_limits<float>::quiet_NaN();  // a driver that does not fill it in
  EXPECT_FALSE(isTurnedRound(scan));
  scan.angle_min = scan.angle_max = 0.0F;  // one beam
  EXPECT_FALSE(isTurnedRound(scan));
}

geometry_msgs::PoseWithCovarianceStamped somePose() {
  geometry_msgs::PoseWithCovarianceStamped message;
  message.header.frame_id = "/odom";
  message.header.stamp = ros::Time(5.0);
  message.pose.pose.position.x = 1.0;
  message.pose.pose.orientation.z = message.pose.pose.orientation.w = std::sqrt(0.5);
  return message;
}

std::string refusalOf(const geometry_msgs::PoseWithCovarianceStamped& message) {
  std::string problem;
  return toGivenPose(message, "odom", &problem) ? "taken" : problem;
}

TEST(Conversions, AGivenPoseIsTakenWithItsCovariance) {
  auto message = somePose();
  EXPECT_TRUE(toGivenPose(message, "odom", nullptr)->covariance.isZero());  // exact
  message.pose.covariance[0] = 0.25;                                        // what rviz sends
  message.pose.covariance[7] = 0.25;
  message.pose.covariance[35] = 0.07;
  const auto pose = toGivenPose(message, "odom", nullptr);
  ASSERT_TRUE(pose);
  EXPECT_NEAR(error(pose->odom_from_base, SE2(1.0, 0.0, M_PI / 2)).norm(), 0.0, 1e-9);
  EXPECT_EQ(pose->covariance.diagonal(), Eigen::Vector3d(0.25, 0.25, 0.07));
  EXPECT_EQ(pose->stamp, std::chrono::seconds(5));
}

TEST(Conversions, AGivenPoseThatIsNoneIsRefusedByValueAndExpectation) {
  auto message = somePose();
  message.header.frame_id = "map";
  EXPECT_EQ(refusalOf(message), "header.frame_id is \"map\": \"odom\" expected");
  message = somePose();
  message.pose.pose.orientation.w = 0.0;
  EXPECT_TRUE(contains(refusalOf(message), "a quaternion of length 1 expected"));
  message = somePose();
  message.pose.pose.position.y = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(contains(refusalOf(message), "position (1, nan): finite numbers expected"));
  message = somePose();
  message.pose.covariance[7] = -1.0;
  EXPECT_TRUE(contains(refusalOf(message), "[0, 0, 0; 0, -1, 0; 0, 0, 0]: finite, symmetric and without negative"));
  message = somePose();
  message.pose.covariance[0] = message.pose.covariance[7] = 1.0;
  message.pose.covariance[1] = 0.5;
  EXPECT_TRUE(contains(refusalOf(message), "symmetric"));
  message = somePose();
  message.pose.covariance[35] = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(contains(refusalOf(message), "finite"));
  message = somePose();
  message.pose.pose.position.x = 1e300;
  EXPECT_TRUE(contains(refusalOf(message), "pose is (1e+300, 0, 1.5708): expected finite values up to 1e+09"));
  message = somePose();
  message.pose.covariance[0] = 1e12;
  EXPECT_TRUE(contains(refusalOf(message), "covariance of the pose is [1e+12, 0, 0; 0, 0, 0; 0, 0, 0]: expected"));
}

TEST(Conversions, TheStatusSaysWhatBecameOfTheScan) {
  ScanReport report;
  report.stamp = std::chrono::seconds(7);
  report.outcome = ScanOutcome::kSlip;
  report.match.pairs.resize(30);
  report.match.overlap = 0.8;
  report.match.agreement = 0.9;
  report.match.misfit = 1.1;
  report.innovation = Innovation();
  report.innovation->residual = Eigen::Vector2d(1.0, 2.0);
  report.innovation->covariance = Eigen::Matrix2d::Identity();
  report.nis_bound = 13.8;
  report.reference_stamp = std::chrono::seconds(4);
  report.older_references = 2;
  report.landmarks_used = 3;
  report.landmarks.resize(7);
  report.calibration.error << 0.03, -0.02, 0.01, 0.07, 0.015, -0.01;
  report.calibration.covariance.diagonal() << 1e-4, 4e-4, 9e-4, 16e-4, 25e-4, 36e-4;
  report.laser_constants = {LaserConstant(0.02), LaserConstant(0.01)};
  report.laser_constants.range_offset.add({0.01, 30.0 / 4e-4, 0.0}, 0.0);
  report.laser_constants.sweep_duration.add({0.006, 30.0 / 1e-4, 0.0}, 0.0);
  report.gyro_bias = {0.01, 4e-6};
  report.gyro_time = 0.1;
  report.heading = HeadingUse::kContradicts;
  report.stands = true;
  report.match_time = 0.001;
  report.total_time = 0.002;
  const auto status = toStatus(report, "sckf", "odom", ros::Time(7.5));
  EXPECT_EQ(status.header.stamp, ros::Time(7.0));
  EXPECT_EQ(status.header.frame_id, "odom");
  EXPECT_EQ(status.method, "sckf");
  EXPECT_EQ(status.outcome, "slip");
  EXPECT_TRUE(status.accepted);
  EXPECT_TRUE(status.wheels_known);
  EXPECT_EQ(status.pairs, 30u);
  EXPECT_EQ(status.overlap, 0.8);
  EXPECT_EQ(status.agreement, 0.9);
  EXPECT_EQ(status.misfit, 1.1);
  EXPECT_EQ(status.dimension, 2);
  EXPECT_NEAR(status.nis, 5.0, 1e-12);
  EXPECT_EQ(status.nis_bound, 13.8);
  EXPECT_EQ(status.reference_age, 3.0);
  EXPECT_EQ(status.older_references, 2);
  EXPECT_EQ(status.landmarks_used, 3);
  EXPECT_EQ(status.landmarks, 7);
  EXPECT_EQ(status.calibration_distance, 0.03);
  EXPECT_EQ(status.calibration_rotation, -0.02);
  EXPECT_EQ(status.calibration_rotation_per_meter, 0.01);
  EXPECT_NEAR(status.calibration_distance_std, 0.01, 1e-12);
  EXPECT_NEAR(status.calibration_rotation_std, 0.02, 1e-12);
  EXPECT_NEAR(status.calibration_rotation_per_meter_std, 0.03, 1e-12);
  EXPECT_EQ(status.calibration_laser_ahead, 0.07);
  EXPECT_NEAR(status.calibration_laser_ahead_std, 0.04, 1e-12);
  EXPECT_EQ(status.calibration_floor_x, 0.015);
  EXPECT_NEAR(status.calibration_floor_x_std, 0.05, 1e-12);
  EXPECT_EQ(status.calibration_floor_y, -0.01);
  EXPECT_NEAR(status.calibration_floor_y_std, 0.06, 1e-12);
  EXPECT_NEAR(status.range_offset, 0.005, 1e-12);
  EXPECT_NEAR(status.range_offset_std, std::sqrt(2e-4), 1e-12);
  EXPECT_NEAR(status.sweep_duration, 0.003, 1e-12);
  EXPECT_NEAR(status.sweep_duration_std, std::sqrt(5e-5), 1e-12);
  EXPECT_EQ(status.gyro_bias, 0.01);
  EXPECT_NEAR(status.gyro_bias_std, 0.002, 1e-12);
  EXPECT_EQ(status.gyro_time, 0.1);
  EXPECT_EQ(status.heading, "contradicts");
  EXPECT_TRUE(status.stands);
  EXPECT_EQ(status.match_time, 0.001);
  EXPECT_EQ(status.total_time, 0.002);
  EXPECT_NEAR(status.latency, 0.5, 1e-9);
}

TEST(Conversions, TheStatusOfAScanThatWasNotUsedHasNoNumbers) {
  ScanReport report;
  report.outcome = ScanOutcome::kGated;
  report.reason = "why";
  const auto status = toStatus(report, "sckf", "odom", ros::Time());
  EXPECT_FALSE(status.accepted);
  EXPECT_EQ(status.reason, "why");
  EXPECT_EQ(status.dimension, 0);
  EXPECT_EQ(status.nis, 0.0);
  EXPECT_EQ(status.reference_age, 0.0);
}

}  // namespace
}  // namespace sckf
