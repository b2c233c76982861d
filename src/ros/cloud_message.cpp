#include "sckf_odometry/ros/cloud_message.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <sstream>

namespace sckf {

namespace {

using sensor_msgs::PointCloud2;
using sensor_msgs::PointField;

constexpr std::array<const char*, 3> kAxes{"x", "y", "z"};

/// Null if there is none of that name.
const PointField* findField(const PointCloud2& cloud, const std::string& name) {
  const auto found = std::find_if(cloud.fields.begin(), cloud.fields.end(),
                                  [&name](const PointField& field) { return field.name == name; });
  return found == cloud.fields.end() ? nullptr : &*found;
}

std::string fieldProblem(const PointCloud2& cloud, const std::string& name) {
  std::ostringstream text;
  const PointField* field = findField(cloud, name);
  if (field == nullptr) {
    text << "fields are";
    for (const PointField& other : cloud.fields) text << " \"" << other.name << "\"";
    text << (cloud.fields.empty() ? " none: " : ": ") << "x, y and z expected";
  } else if (field->datatype != PointField::FLOAT32) {
    text << "field " << name << " has datatype " << static_cast<int>(field->datatype) << ": "
         << static_cast<int>(PointField::FLOAT32) << " (float32) expected";
  } else if (std::uint64_t{field->offset} + sizeof(float) > cloud.point_step) {
    text << "field " << name << " has offset " << field->offset << ", point_step is " << cloud.point_step
         << ": a field within the point expected";
  }
  return text.str();
}

std::string sizeProblem(const PointCloud2& cloud) {
  std::ostringstream text;
  const std::uint64_t width = cloud.width;
  const std::uint64_t height = cloud.height;
  if (width * cloud.point_step > cloud.row_step) {
    text << "row_step is " << cloud.row_step << ", width " << width << ", point_step " << cloud.point_step
         << ": rows of width points expected";
  } else if (height * cloud.row_step > cloud.data.size()) {
    text << "data has " << cloud.data.size() << " bytes, height is " << height << ", row_step " << cloud.row_step
         << ": height rows expected";
  }
  return text.str();
}

}  // namespace

std::string cloudProblem(const PointCloud2& cloud) {
  if (cloud.width == 0 || cloud.height == 0) {
    std::ostringstream text;
    text << "width is " << cloud.width << ", height " << cloud.height << ": points expected";
    return text.str();
  }
  const std::uint16_t one = 1;
  std::uint8_t low = 0;
  std::memcpy(&low, &one, 1);
  const bool machine_is_bigendian = low == 0;
  if (static_cast<bool>(cloud.is_bigendian) != machine_is_bigendian) {
    return std::string("is_bigendian is ") + (cloud.is_bigendian ? "true" : "false") +
           ": the order of bytes of this machine expected";
  }
  for (const char* axis : kAxes) {
    const std::string problem = fieldProblem(cloud, axis);
    if (!problem.empty()) return problem;
  }
  return sizeProblem(cloud);
}

std::vector<Eigen::Vector3f> toPoints(const PointCloud2& cloud) {
  std::array<std::size_t, 3> offsets{};
  std::transform(kAxes.begin(), kAxes.end(), offsets.begin(),
                 [&cloud](const char* axis) { return findField(cloud, axis)->offset; });
  std::vector<Eigen::Vector3f> points;
  points.reserve(std::size_t{cloud.width} * cloud.height);
  for (std::size_t row = 0; row < cloud.height; ++row) {
    for (std::size_t column = 0; column < cloud.width; ++column) {
      const std::uint8_t* begin = cloud.data.data() + row * cloud.row_step + column * cloud.point_step;
      Eigen::Vector3f point;
      for (std::size_t axis = 0; axis < 3; ++axis)
        std::memcpy(&point[static_cast<Eigen::Index>(axis)], begin + offsets[axis], sizeof(float));
      points.push_back(point);
    }
  }
  return points;
}

}  // namespace sckf
