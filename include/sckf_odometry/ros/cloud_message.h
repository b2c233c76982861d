// Clouds of points as messages.
#pragma once

#include <sensor_msgs/PointCloud2.h>

#include <Eigen/Core>
#include <string>
#include <vector>

namespace sckf {

/// What is wrong with a cloud before any of its points is looked at, in words: value and what is expected. Empty if it
/// has points, with x, y and z as float32 in them, where its sizes say.
std::string cloudProblem(const sensor_msgs::PointCloud2& cloud);

/// Its points, in its own frame; such as are not finite too. There must be nothing wrong with it.
std::vector<Eigen::Vector3f> toPoints(const sensor_msgs::PointCloud2& cloud);

}  // namespace sckf
