#include "sckf_odometry/matching/nearest_neighbours.h"

#include <cmath>

namespace sckf {

NearestNeighbours::NearestNeighbours(const PreparedScan& reference, const PreparedScan& current)
    : reference_(reference), current_(current), nearest_(current.size()) {}

void NearestNeighbours::ask(const Eigen::Vector2d& point, Nearest& nearest) {
  constexpr double kRounding = 1e-5;  // [m] of the tree, whose numbers have seven digits
  reference_.map.kdTreeNClosestPoint2DIdx(static_cast<float>(point.x()), static_cast<float>(point.y()), 2, indices_,
                                          squares_);
  ++queries_;
  const double distance = std::sqrt(static_cast<double>(squares_[0]));
  const double lead = std::sqrt(static_cast<double>(squares_[1])) - distance;
  nearest = {point, static_cast<int>(indices_[0]), distance - kRounding, 0.5 * lead - kRounding};
}

std::vector<Pair> NearestNeighbours::pairs(const RigidMotion& reference_from_current, double max_distance) {
  std::vector<Pair> pairs;
  if (reference_.size() == 0) return pairs;
  pairs.reserve(nearest_.size());
  for (std::size_t i = 0; i < nearest_.size(); ++i) {
    const Eigen::Vector2d point = reference_from_current * current_.points.point[i];
    Nearest& nearest = nearest_[i];
    const double moved = (point - nearest.asked_at).norm();
    if (moved < nearest.distance - max_distance) continue;  // too far from any still
    if (moved >= nearest.valid_within) ask(point, nearest);
    const Eigen::Vector2d& other = reference_.points.point[static_cast<std::size_t>(nearest.reference)];
    if ((point - other).squaredNorm() <= max_distance * max_distance) {
      pairs.push_back({nearest.reference, static_cast<int>(i)});
    }
  }
  return pairs;
}

}  // namespace sckf
