// What is published on TF, for tests.
#pragma once

#include <string>

#include "sckf_odometry/ros/conversions.h"

namespace sckf::test {

/// Of a child in its parent. time: [s]
inline geometry_msgs::TransformStamped transform(const std::string& parent, const std::string& child, double time = 0.0,
                                                 const SE2& pose = SE2()) {
  return toTransform(pose, toStamp(ros::Time(time)), parent, child);
}

}  // namespace sckf::test
