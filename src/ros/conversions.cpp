#include "sckf_odometry/ros/conversions.h"

#include <sensor_msgs/point_cloud2_iterator.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "sckf_odometry/core/covariance.h"

namespace sckf {

namespace {

// Axes of the 6 × 6 covariances of geometry_msgs, row by row in this order.
enum Axis : std::size_t { kX, kY, kZ, kRoll, kPitch, kYaw, kAxes };
constexpr std::array<Axis, 3> kPlane{kX, kY, kYaw};

using MessageCovariance = boost::array<double, kAxes * kAxes>;

constexpr std::size_t index(Axis row, Axis column) { return row * kAxes + column; }

MessageCovariance toMessageCovariance(const Eigen::Matrix3d& planar) {
  MessageCovariance covariance;
  covariance.fill(0.0);
  for (const Axis axis : {kZ, kRoll, kPitch}) covariance[index(axis, axis)] = kVarianceOutOfPlane;
  for (std::size_t i = 0; i < kPlane.size(); ++i) {
    for (std::size_t j = 0; j < kPlane.size(); ++j) {
      covariance[index(kPlane[i], kPlane[j])] = planar(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
    }
  }
  return covariance;
}

Eigen::Matrix3d toPlanarCovariance(const MessageCovariance& covariance) {
  Eigen::Matrix3d planar;
  for (std::size_t i = 0; i < kPlane.size(); ++i) {
    for (std::size_t j = 0; j < kPlane.size(); ++j) {
      planar(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = covariance[index(kPlane[i], kPlane[j])];
    }
  }
  return planar;
}

geometry_msgs::Quaternion toQuaternion(double yaw) {
  geometry_msgs::Quaternion quaternion;
  quaternion.z = std::sin(0.5 * yaw);
  quaternion.w = std::cos(0.5 * yaw);
  return quaternion;
}

geometry_msgs::Pose toPose(const SE2& pose) {
  geometry_msgs::Pose message;
  message.position.x = pose.x;
  message.position.y = pose.y;
  message.orientation = toQuaternion(pose.yaw);
  return message;
}

Eigen::Quaterniond toEigen(const geometry_msgs::Quaternion& q) { return {q.w, q.x, q.y, q.z}; }

std::optional<SE2> planar(double x, double y, const geometry_msgs::Quaternion& orientation, std::string* problem) {
  constexpr double kTolerance = 0.01;  // of the quaternion's length: rounding, not a field that was never filled in
  const Eigen::Quaterniond q = toEigen(orientation);
  std::ostringstream text;
  if (!std::isfinite(x) || !std::isfinite(y)) {
    text << "position (" << x << ", " << y << "): finite numbers expected";
  } else if (!(std::abs(q.norm() - 1.0) <= kTolerance)) {
    text << "orientation (" << q.x() << ", " << q.y() << ", " << q.z() << ", " << q.w()
         << "): a quaternion of length 1 expected";
  } else {
    return toPlanar(Eigen::Isometry3d(Eigen::Translation3d(x, y, 0.0) * q.normalized()));
  }
  if (problem != nullptr) *problem = text.str();
  return std::nullopt;
}

}  // namespace

Stamp toStamp(const ros::Time& time) { return Stamp(static_cast<Stamp::rep>(time.toNSec())); }

Stamp now() { return toStamp(ros::Time::now()); }

ros::Time toTime(Stamp stamp) { return ros::Time().fromNSec(static_cast<uint64_t>(stamp.count())); }

std::string duplicateOf(Stamp stamp) {
  std::ostringstream text;
  text << "header.stamp is " << toTime(stamp) << ": there is one of that stamp already";
  return text.str();
}

std::string afterAScan(Stamp stamp, Stamp newest_odometry) {
  constexpr double kLongLate = 0.5;  // [s] messages are not on their way for longer
  std::ostringstream text;
  text << "it came after a scan that was taken later: header.stamp is " << toTime(stamp) << ", "
       << seconds(newest_odometry - stamp) << " s before the newest odometry, " << toTime(newest_odometry);
  if (seconds(newest_odometry - stamp) > kLongLate) text << ": are the clocks synchronised?";
  return text.str();
}

std::string frameName(const std::string& frame) {
  return !frame.empty() && frame.front() == '/' ? frame.substr(1) : frame;
}

LaserScan toScan(const sensor_msgs::LaserScan& message) {
  LaserScan scan;
  scan.stamp = toStamp(message.header.stamp);
  scan.angle_min = static_cast<double>(message.angle_min);
  scan.angle_increment = static_cast<double>(message.angle_increment);
  scan.time_increment = static_cast<double>(message.time_increment);
  scan.range_min = static_cast<double>(message.range_min);
  scan.range_max = static_cast<double>(message.range_max);
  scan.ranges = message.ranges;
  return scan;
}

bool isTurnedRound(const sensor_msgs::LaserScan& message) {
  return (message.angle_max - message.angle_min) * message.angle_increment < 0.0F;
}

std::optional<SE2> toPlanar(const geometry_msgs::Pose& pose, std::string* problem) {
  return planar(pose.position.x, pose.position.y, pose.orientation, problem);
}

std::optional<SE2> toPlanar(const geometry_msgs::Transform& transform, std::string* problem) {
  return planar(transform.translation.x, transform.translation.y, transform.rotation, problem);
}

SE2 toPlanar(const Eigen::Isometry3d& transform) {
  const Eigen::Vector3d ahead = transform.linear().col(0);
  return {transform.translation().x(), transform.translation().y(), std::atan2(ahead.y(), ahead.x())};
}

Eigen::Isometry3d toIsometry(const geometry_msgs::Transform& transform) {
  const auto& t = transform.translation;
  return Eigen::Translation3d(t.x, t.y, t.z) * toEigen(transform.rotation).normalized();
}

std::optional<OdometrySample> toOdometrySample(const nav_msgs::Odometry& message, std::string* problem) {
  const std::optional<SE2> pose = toPlanar(message.pose.pose, problem);
  if (!pose) return std::nullopt;
  OdometrySample sample;
  sample.stamp = toStamp(message.header.stamp);
  sample.odom_from_base = *pose;
  const Eigen::Matrix3d twist_covariance = toPlanarCovariance(message.twist.covariance);
  if (twist_covariance.allFinite()) sample.twist_covariance = twist_covariance;
  return sample;
}

OdometrySample moved(const OdometrySample& sample, const SE2& child_from_base) {
  OdometrySample result = sample;
  result.odom_from_base = compose(sample.odom_from_base, child_from_base);
  if (sample.twist_covariance) {
    // The velocity of the origin of base, v + ω × p, turned into base.
    Eigen::Matrix3d J_base_child = Eigen::Matrix3d::Identity();
    const Eigen::Matrix2d R_child_to_base = child_from_base.rotation().transpose();
    J_base_child.topLeftCorner<2, 2>() = R_child_to_base;
    J_base_child.topRightCorner<2, 1>() = R_child_to_base * Eigen::Vector2d(-child_from_base.y, child_from_base.x);
    result.twist_covariance = J_base_child * *sample.twist_covariance * J_base_child.transpose();
  }
  return result;
}

std::optional<ImuSample> toImuSample(const sensor_msgs::Imu& message, const Eigen::Isometry3d& base_from_imu,
                                     const ImuOptions& used, std::string* problem) {
  ImuSample sample;
  sample.stamp = toStamp(message.header.stamp);
  std::ostringstream text;
  const auto isGiven = [&text](const auto& covariance, const char* of) {
    if (covariance[0] != -1.0) return true;
    text << of << "_covariance[0] is -1, which says that it is not measured; ";
    return false;
  };
  const auto& w = message.angular_velocity;
  if (used.gyro && isGiven(message.angular_velocity_covariance, "angular_velocity")) {
    const double yaw_rate = (base_from_imu.linear() * Eigen::Vector3d(w.x, w.y, w.z)).z();
    if (std::isfinite(yaw_rate)) {
      sample.yaw_rate = yaw_rate;
    } else {
      text << "angular_velocity (" << w.x << ", " << w.y << ", " << w.z << "): finite numbers expected; ";
    }
  }
  if (used.orientation && isGiven(message.orientation_covariance, "orientation")) {
    std::string quaternion_problem;
    if (planar(0.0, 0.0, message.orientation, &quaternion_problem)) {
      const Eigen::Quaterniond world_from_imu = toEigen(message.orientation).normalized();
      sample.yaw = toPlanar(Eigen::Isometry3d(world_from_imu * base_from_imu.linear().transpose())).yaw;
    } else {
      text << quaternion_problem << "; ";
    }
  }
  if (sample.yaw_rate || sample.yaw) return sample;
  *problem = text.str().substr(0, text.str().size() - 2);
  return std::nullopt;
}

std::string covarianceProblem(const MessageCovariance& covariance) {
  const Eigen::Matrix3d planar = toPlanarCovariance(covariance);
  if (isCovariance(planar)) return "";
  const Eigen::IOFormat in_one_line(6, Eigen::DontAlignCols, ", ", "; ", "", "", "[", "]");
  std::ostringstream text;
  text << "covariance of x, y, yaw " << planar.format(in_one_line)
       << ": finite, symmetric and without negative eigenvalue expected";
  return text.str();
}

std::optional<GivenPose> toGivenPose(const geometry_msgs::PoseWithCovarianceStamped& message,
                                     const std::string& odom_frame, std::string* problem) {
  if (frameName(message.header.frame_id) != odom_frame) {
    *problem = "header.frame_id is \"" + message.header.frame_id + "\": \"" + odom_frame + "\" expected";
    return std::nullopt;
  }
  const std::optional<SE2> pose = toPlanar(message.pose.pose, problem);
  if (!pose) return std::nullopt;
  const GivenPose given{*pose, toPlanarCovariance(message.pose.covariance), toStamp(message.header.stamp)};
  std::string wrong = covarianceProblem(message.pose.covariance);
  if (wrong.empty()) wrong = problemOf(given.odom_from_base, given.covariance);
  if (wrong.empty()) return given;
  *problem = wrong;
  return std::nullopt;
}

nav_msgs::Odometry toOdometryMessage(const Estimate& estimate, const std::string& odom_frame,
                                     const std::string& base_frame) {
  nav_msgs::Odometry message;
  message.header.stamp = toTime(estimate.stamp);
  message.header.frame_id = odom_frame;
  message.child_frame_id = base_frame;
  message.pose.pose = toPose(estimate.odom_from_base);
  message.pose.covariance = toMessageCovariance(estimate.covariance);
  message.twist.twist.linear.x = estimate.twist.mean.x();
  message.twist.twist.linear.y = estimate.twist.mean.y();
  message.twist.twist.angular.z = estimate.twist.mean.z();
  message.twist.covariance = toMessageCovariance(estimate.twist.covariance);
  return message;
}

geometry_msgs::PoseWithCovarianceStamped toPoseMessage(Stamp stamp, const SE2& pose, const Eigen::Matrix3d& covariance,
                                                       const std::string& frame) {
  geometry_msgs::PoseWithCovarianceStamped message;
  message.header.stamp = toTime(stamp);
  message.header.frame_id = frame;
  message.pose.pose = toPose(pose);
  message.pose.covariance = toMessageCovariance(covariance);
  return message;
}

geometry_msgs::PoseStamped toPoseStamped(const SE2& pose, Stamp stamp, const std::string& frame) {
  geometry_msgs::PoseStamped message;
  message.header.stamp = toTime(stamp);
  message.header.frame_id = frame;
  message.pose = toPose(pose);
  return message;
}

sensor_msgs::PointCloud2 toPointCloud(const std::vector<Eigen::Vector2d>& points, Stamp stamp,
                                      const std::string& frame) {
  sensor_msgs::PointCloud2 cloud;
  cloud.header.stamp = toTime(stamp);
  cloud.header.frame_id = frame;
  sensor_msgs::PointCloud2Modifier modifier(cloud);
  modifier.setPointCloud2FieldsByString(1, "xyz");
  modifier.resize(points.size());
  sensor_msgs::PointCloud2Iterator<float> out(cloud, "x");
  for (const Eigen::Vector2d& point : points) {
    out[0] = static_cast<float>(point.x());
    out[1] = static_cast<float>(point.y());
    out[2] = 0.0F;
    ++out;
  }
  return cloud;
}

sckf_odometry::Status toStatus(const ScanReport& report, const std::string& method, const std::string& odom_frame,
                               const ros::Time& now) {
  sckf_odometry::Status status;
  status.header.stamp = toTime(report.stamp);
  status.header.frame_id = odom_frame;
  status.method = method;
  status.outcome = toString(report.outcome);
  status.reason = report.reason;
  status.accepted = wasUsed(report.outcome);
  status.new_reference = report.new_reference;
  status.older_references = static_cast<std::uint8_t>(std::min(report.older_references, 255));
  status.landmarks = static_cast<std::uint16_t>(report.landmarks.size());
  status.landmarks_used = static_cast<std::uint16_t>(report.landmarks_used);
  status.wheels_known = report.wheels_known;
  status.deskewed = report.deskewing == Deskewing::kDone;
  status.pairs = static_cast<uint32_t>(report.match.pairs.size());
  status.overlap = report.match.overlap;
  status.agreement = report.match.agreement;
  status.misfit = report.match.misfit;
  if (report.innovation) {
    status.dimension = static_cast<uint8_t>(report.innovation->residual.size());
    status.nis = report.innovation->nis();
    status.nis_bound = report.nis_bound;
  }
  if (report.reference_stamp != Stamp(0)) status.reference_age = seconds(report.stamp - report.reference_stamp);
  const WheelCalibration::Vector calibration_std = report.calibration.covariance.diagonal().cwiseSqrt();
  const auto& [range_offset, sweep_duration] = report.laser_constants;
  status.range_offset = range_offset.value();
  status.range_offset_std = std::sqrt(range_offset.variance());
  status.sweep_duration = sweep_duration.value();
  status.sweep_duration_std = std::sqrt(sweep_duration.variance());
  status.calibration_distance = report.calibration.error(0);
  status.calibration_distance_std = calibration_std(0);
  status.calibration_rotation = report.calibration.error(1);
  status.calibration_rotation_std = calibration_std(1);
  status.calibration_rotation_per_meter = report.calibration.error(2);
  status.calibration_rotation_per_meter_std = calibration_std(2);
  status.calibration_laser_ahead = report.calibration.error(3);
  status.calibration_laser_ahead_std = calibration_std(3);
  status.calibration_floor_x = report.calibration.error(4);
  status.calibration_floor_x_std = calibration_std(4);
  status.calibration_floor_y = report.calibration.error(5);
  status.calibration_floor_y_std = calibration_std(5);
  status.gyro_bias = report.gyro_bias.value;
  status.gyro_bias_std = std::sqrt(report.gyro_bias.variance);
  status.gyro_time = report.gyro_time;
  status.heading = toString(report.heading);
  status.stands = report.stands;
  status.match_time = report.match_time;
  status.total_time = report.total_time;
  status.latency = now.toSec() - toTime(report.stamp).toSec();
  return status;
}

geometry_msgs::TransformStamped toTransform(const SE2& frame_from_child, Stamp stamp, const std::string& frame,
                                            const std::string& child_frame) {
  geometry_msgs::TransformStamped message;
  message.header.stamp = toTime(stamp);
  message.header.frame_id = frame;
  message.child_frame_id = child_frame;
  message.transform.translation.x = frame_from_child.x;
  message.transform.translation.y = frame_from_child.y;
  message.transform.rotation = toQuaternion(frame_from_child.yaw);
  return message;
}

}  // namespace sckf
