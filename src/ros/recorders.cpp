#include "sckf_odometry/ros/recorders.h"

#include <cmath>

#include "sckf_odometry/ros/conversions.h"

namespace sckf {

void PathRecorder::add(Stamp stamp, const SE2& pose) {
  newest_ = {stamp, pose};
  if (!poses_.empty() && (poses_.back().pose.translation() - pose.translation()).norm() < min_distance_) return;
  poses_.push_back(newest_);
  if (poses_.size() <= max_poses_) return;
  for (std::size_t i = 0; 2 * i < poses_.size(); ++i) poses_[i] = poses_[2 * i];
  poses_.resize((poses_.size() + 1) / 2);
  min_distance_ *= 2.0;
}

nav_msgs::Path PathRecorder::message(const std::string& frame) const {
  nav_msgs::Path path;
  path.header.frame_id = frame;
  path.header.stamp = toTime(newest_.stamp);
  path.poses.reserve(poses_.size() + 1);
  for (const StampedPose& stamped : poses_) path.poses.push_back(toPoseStamped(stamped.pose, stamped.stamp, frame));
  if (!poses_.empty() && poses_.back().stamp != newest_.stamp) {
    path.poses.push_back(toPoseStamped(newest_.pose, newest_.stamp, frame));
  }
  return path;
}

std::int64_t CloudRecorder::cell(const Eigen::Vector2d& point) const {
  const auto column = static_cast<std::int32_t>(std::floor(point.x() / resolution_));
  const auto row = static_cast<std::int32_t>(std::floor(point.y() / resolution_));
  return column * (std::int64_t{1} << 32) + static_cast<std::uint32_t>(row);
}

void CloudRecorder::add(const SE2& odom_from_base, const std::vector<Eigen::Vector2d>& points_in_base) {
  for (const Eigen::Vector2d& point_in_base : points_in_base) {
    const Eigen::Vector2d point = odom_from_base * point_in_base;
    if (!occupied_.insert(cell(point)).second) continue;
    points_.push_back(point);
    if (points_.size() <= max_points_) continue;
    occupied_.erase(cell(points_.front()));
    points_.pop_front();
  }
}

sensor_msgs::PointCloud2 CloudRecorder::message(Stamp stamp, const std::string& frame) const {
  return toPointCloud({points_.begin(), points_.end()}, stamp, frame);
}

}  // namespace sckf
