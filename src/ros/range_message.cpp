#include "sckf_odometry/ros/range_message.h"

#include "sckf_odometry/ros/cloud_message.h"
#include "sckf_odometry/ros/conversions.h"

namespace sckf {

MountedScan toMountedScan(const RangeMessage& message, const Eigen::Isometry3d& base_from_sensor,
                          const CloudOptions& clouds) {
  if (const auto* scan = std::get_if<sensor_msgs::LaserScan::ConstPtr>(&message.content)) {
    return {toScan(**scan), base_from_sensor};
  }
  const auto& cloud = std::get<sensor_msgs::PointCloud2::ConstPtr>(message.content);
  return projected(toPoints(*cloud), toStamp(message.header.stamp), base_from_sensor, clouds);
}

}  // namespace sckf
