#include "sckf_odometry/matching/point_cloud.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sckf {

namespace {

/// A level laser below or above the sensor.
Eigen::Isometry3d levelMount(const Eigen::Isometry3d& base_from_sensor) {
  Eigen::Isometry3d base_from_laser = Eigen::Isometry3d::Identity();
  base_from_laser.translation().head<2>() = base_from_sensor.translation().head<2>();
  return base_from_laser;
}

}  // namespace

MountedScan projected(const std::vector<Eigen::Vector3f>& points, Stamp stamp,
                      const Eigen::Isometry3d& base_from_sensor, const CloudOptions& options) {
  const double bin = 2.0 * M_PI / options.beams;
  MountedScan mounted{LaserScan(), levelMount(base_from_sensor)};
  LaserScan& scan = mounted.scan;
  scan.stamp = stamp;
  scan.angle_min = -M_PI + 0.5 * bin;
  scan.angle_increment = bin;
  scan.range_min = options.range_min;
  scan.range_max = options.range_max;
  scan.ranges.assign(static_cast<std::size_t>(options.beams), std::numeric_limits<float>::infinity());
  for (const Eigen::Vector3f& point : points) {
    const Eigen::Vector3d p = base_from_sensor * point.cast<double>();
    if (!(p.z() >= options.height_min && p.z() <= options.height_max)) continue;
    const Eigen::Vector2d seen = p.head<2>() - mounted.base_from_laser.translation().head<2>();
    const double range = seen.norm();
    if (!(range >= options.range_min && range < options.range_max)) continue;
    const auto index = static_cast<std::size_t>((std::atan2(seen.y(), seen.x()) + M_PI) / bin);
    float& nearest = scan.ranges[std::min(index, scan.ranges.size() - 1)];
    nearest = std::min(nearest, static_cast<float>(range));
  }
  return mounted;
}

}  // namespace sckf
