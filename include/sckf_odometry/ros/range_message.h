// What sensors of ranges send: scans and clouds.
#pragma once

#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/Header.h>

#include <Eigen/Geometry>
#include <variant>

#include "sckf_odometry/matching/point_cloud.h"

namespace sckf {

/// A message of either kind, whose layout is sound.
struct RangeMessage {
  std_msgs::Header header;
  std::variant<sensor_msgs::LaserScan::ConstPtr, sensor_msgs::PointCloud2::ConstPtr> content;
};

/// The scan, or the cloud as a scan. base_from_sensor: the pose of the message's frame.
MountedScan toMountedScan(const RangeMessage& message, const Eigen::Isometry3d& base_from_sensor,
                          const CloudOptions& clouds);

}  // namespace sckf
