#include "sckf_odometry/matching/nearest_neighbours.h"

#include <cmath>

namespace sckf {

NearestNeighbours::NearestNeighbours(const PreparedScan& reference, const PreparedScan& current)
    : reference_(reference), current_(current), nearest_(current.size()) {}

void NearestNeighbours::ask(const Eigen::Vector2d& point, double within, Nearest& nearest) {
  const PointTree::Answer answer = reference_.tree.nearest(point, within);
  ++queries_;
  nearest = {point, static_cast<int>(answer.nearest), answer.distance, 0.5 * (answer.next - answer.distance)};
}

std::vector<Pair> NearestNeighbours::pairs(const RigidMotion& reference_from_current, double max_distance) {
  constexpr double kFarther = 0.1;  // [m] a point without a partner stays without one until it has moved so far
  std::vector<Pair> pairs;
  if (reference_.size() == 0) return pairs;
  pairs.reserve(nearest_.size());
  for (std::size_t i = 0; i < nearest_.size(); ++i) {
    const Eigen::Vector2d point = reference_from_current * current_.points.point[i];
    Nearest& nearest = nearest_[i];
    const double moved = (point - nearest.asked_at).norm();
    if (moved < nearest.distance - max_distance) continue;  // too far from any still
    if (moved >= nearest.valid_within) ask(point, max_distance + kFarther, nearest);
    const Eigen::Vector2d& other = reference_.points.point[static_cast<std::size_t>(nearest.reference)];
    if ((point - other).squaredNorm() <= max_distance * max_distance) {
      pairs.push_back({nearest.reference, static_cast<int>(i)});
    }
  }
  return pairs;
}

}  // namespace sckf
