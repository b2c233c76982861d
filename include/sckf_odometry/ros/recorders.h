// What rviz is shown of a run: trajectories and the scans drawn along them, bounded in memory.
#pragma once

#include <nav_msgs/Path.h>
#include <sensor_msgs/PointCloud2.h>

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <string>
#include <unordered_set>
#include <vector>

#include "sckf_odometry/core/se2.h"
#include "sckf_odometry/matching/laser_scan.h"

namespace sckf {

/// A trajectory with a pose about every min_distance; when there are more than max_poses, every second one is dropped
/// and the distance doubled, so that the whole run stays in view.
class PathRecorder {
 public:
  PathRecorder(double min_distance, std::size_t max_poses) : min_distance_(min_distance), max_poses_(max_poses) {}

  void add(Stamp stamp, const SE2& pose);
  bool empty() const { return poses_.empty(); }
  nav_msgs::Path message(const std::string& frame) const;  ///< up to the newest pose, however near

 private:
  struct StampedPose {
    Stamp stamp;
    SE2 pose;
  };
  double min_distance_;  // [m]
  std::size_t max_poses_;
  std::vector<StampedPose> poses_;
  StampedPose newest_{};
};

/// Points in the plane, at most one in each square of a grid; when there are too many, the oldest go.
class CloudRecorder {
 public:
  CloudRecorder(double resolution, std::size_t max_points) : resolution_(resolution), max_points_(max_points) {}

  void add(const SE2& odom_from_base, const std::vector<Eigen::Vector2d>& points_in_base);
  bool empty() const { return points_.empty(); }
  sensor_msgs::PointCloud2 message(Stamp stamp, const std::string& frame) const;

 private:
  std::int64_t cell(const Eigen::Vector2d& point) const;

  double resolution_;  // [m]
  std::size_t max_points_;
  std::deque<Eigen::Vector2d> points_;  // in odom
  std::unordered_set<std::int64_t> occupied_;
};

}  // namespace sckf
