#include "sckf_odometry/matching/free_space.h"

#include <algorithm>
#include <cmath>

#include "sckf_odometry/core/se2.h"

namespace sckf {

FreeSpace::FreeSpace(const LaserScan& scan, const Eigen::Isometry3d& base_from_laser, const ScannedPoints& points,
                     double margin)
    : origin_(base_from_laser.translation().head<2>()), square_reach_(scan.ranges.size(), 0.0) {
  const Eigen::Matrix3d& C = base_from_laser.linear();
  const double sense = C(2, 2) < 0.0 ? -1.0 : 1.0;  // upside down, beams go round the other way
  first_bearing_ = wrapAngle(std::atan2(C(1, 0), C(0, 0)) + sense * scan.angle_min);
  increment_ = sense * scan.angle_increment;
  beams_in_a_turn_ = 2.0 * M_PI / std::abs(increment_);
  const auto distance = [&](std::size_t i) { return (points.point[i] - origin_).norm(); };
  for (std::size_t i = 1; i + 1 < points.size(); ++i) {
    if (points.beam[i + 1] - points.beam[i - 1] != 2) continue;
    const double reach = std::min({distance(i - 1), distance(i), distance(i + 1)}) - margin;
    const std::optional<std::size_t> beam = beamTowards(points.point[i] - origin_);
    if (!beam || reach <= 0.0) continue;
    double& square = square_reach_[*beam];
    square = square > 0.0 ? std::min(square, reach * reach) : reach * reach;
  }
}

std::optional<std::size_t> FreeSpace::beamTowards(const Eigen::Vector2d& d) const {
  double beam = (std::atan2(d.y(), d.x()) - first_bearing_) / increment_ + 0.5;  // rounded when it is cut off below
  if (beam < 0.0) beam += beams_in_a_turn_;
  if (beam >= beams_in_a_turn_) beam -= beams_in_a_turn_;
  // Before it is made an integer: beams may be so near each other that it is one of more than there are integers.
  if (!(beam < static_cast<double>(square_reach_.size()))) return std::nullopt;
  return static_cast<std::size_t>(beam);
}

bool FreeSpace::contains(const Eigen::Vector2d& point) const {
  const Eigen::Vector2d d = point - origin_;
  const std::optional<std::size_t> beam = beamTowards(d);
  return beam && d.squaredNorm() < square_reach_[*beam];
}

}  // namespace sckf
