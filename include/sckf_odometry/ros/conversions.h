// Messages to the package's types and back.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/PointCloud2.h>

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "sckf_odometry/Status.h"
#include "sckf_odometry/pipeline/scan_odometry.h"

namespace sckf {

Stamp toStamp(const ros::Time& time);
/// ROS time: a clock's, or the one on /clock.
Stamp now();
ros::Time toTime(Stamp stamp);

/// Why odometry or a reading of an IMU is refused: another has its stamp; a scan that was taken later has been used.
std::string duplicateOf(Stamp stamp);
std::string afterAScan(Stamp stamp, Stamp newest_odometry);

/// The name without the leading slash that old drivers put before it and tf2 refuses.
std::string frameName(const std::string& frame);

/// The scan as it is: which ranges can be used is decided where it is matched. angle_max is not looked at: beam i is at
/// angle_min + i · angle_increment by the definition of the message, while drivers disagree about whether angle_max is
/// the last beam or the one after it, and round it.
LaserScan toScan(const sensor_msgs::LaserScan& message);

/// Whether angle_max lies on the other side of angle_min than angle_increment goes: then one of them has the wrong
/// sign, and the scan may be its mirror image.
bool isTurnedRound(const sensor_msgs::LaserScan& message);

/// x, y and yaw of a pose. Empty, with the problem in words, if a number is not finite or the quaternion is not of unit
/// length: a driver that never filled it in.
std::optional<SE2> toPlanar(const geometry_msgs::Pose& pose, std::string* problem);
std::optional<SE2> toPlanar(const geometry_msgs::Transform& transform, std::string* problem);
SE2 toPlanar(const Eigen::Isometry3d& transform);
Eigen::Isometry3d toIsometry(const geometry_msgs::Transform& transform);

/// Pose of the message's child frame, with the covariance of its twist if that is finite. Empty, with the problem in
/// words, if the pose cannot be used.
std::optional<OdometrySample> toOdometrySample(const nav_msgs::Odometry& message, std::string* problem);

/// The same for another frame fixed to the robot, odom_from_base = odom_from_child ⊕ child_from_base; the twist
/// covariance with it.
OdometrySample moved(const OdometrySample& sample, const SE2& child_from_base);

/// What is used of an IMU's message, of base_link, which lies in the plane. A covariance that begins with -1 says that
/// there is no such reading (REP-145). Empty, with the problem in words, if there is none that is used.
std::optional<ImuSample> toImuSample(const sensor_msgs::Imu& message, const Eigen::Isometry3d& base_from_imu,
                                     const ImuOptions& used, std::string* problem);

/// What is wrong with a covariance of six axes in the plane, in words: value and what is expected; empty if nothing is.
/// Zero is allowed.
std::string covarianceProblem(const boost::array<double, 36>& covariance);

/// Where somebody says that the robot is, or was.
struct GivenPose {
  SE2 odom_from_base;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of the additive error in x, y, yaw; zero: exact
  Stamp stamp{0};                                        ///< zero: now
};

/// Empty, with the problem in words, if the pose is in another frame or is none, or the covariance is none.
std::optional<GivenPose> toGivenPose(const geometry_msgs::PoseWithCovarianceStamped& message,
                                     const std::string& odom_frame, std::string* problem);

/// The robot lives in the plane: z, roll, pitch and their rates are zero, and known, so that their variances are this
/// small value [m², rad², and per s²] and not zero, which other packages cannot invert, nor large, which rviz draws.
constexpr double kVarianceOutOfPlane = 1e-6;

/// Pose in odom_frame, twist in base_frame.
nav_msgs::Odometry toOdometryMessage(const Estimate& estimate, const std::string& odom_frame,
                                     const std::string& base_frame);
geometry_msgs::PoseWithCovarianceStamped toPoseMessage(Stamp stamp, const SE2& pose, const Eigen::Matrix3d& covariance,
                                                       const std::string& frame);
geometry_msgs::PoseStamped toPoseStamped(const SE2& pose, Stamp stamp, const std::string& frame);

/// Points in the plane of the frame.
sensor_msgs::PointCloud2 toPointCloud(const std::vector<Eigen::Vector2d>& points, Stamp stamp,
                                      const std::string& frame);

/// now: ROS time.
sckf_odometry::Status toStatus(const ScanReport& report, const std::string& method, const std::string& odom_frame,
                               const ros::Time& now);

/// The transform that takes coordinates in child_frame to coordinates in frame.
geometry_msgs::TransformStamped toTransform(const SE2& frame_from_child, Stamp stamp, const std::string& frame,
                                            const std::string& child_frame);

}  // namespace sckf
