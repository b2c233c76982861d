// The one place that decides most of what two scans tell: the only door frame in sight along a corridor, or somebody
// who walks there.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "sckf_odometry/matching/observability.h"
#include "sckf_odometry/matching/surface.h"

namespace sckf {

/// Points of the current scan that stand together, and how far the displacement goes with them.
struct DecisivePlace {
  std::vector<int> points;  ///< ascending
  /// ∂(x, y, yaw)/∂(where the place is, in the reference base_link) [1, 1, rad/m], 3 × 2.
  Eigen::Matrix<double, 3, 2> influence = Eigen::Matrix<double, 3, 2>::Zero();

  bool contains(int point) const { return std::binary_search(points.begin(), points.end(), point); }
  /// How far the displacement goes at most, per metre that the place goes: nearly 0 where much is seen all around, 1
  /// where nothing else tells of a direction.
  double share() const;
};

/// What the displacement has of one point of the current scan.
struct PointPull {
  int point = 0;
  /// ∂²L/∂x∂p, 3 × 2: of the loss by the displacement and by where the point is, in the reference base_link [1/m²,
  /// 1/m², 1/m].
  Eigen::Matrix<double, 3, 2> by_position = Eigen::Matrix<double, 3, 2>::Zero();
};

/// Of all places, points no farther than size [m] from one of them, the one with which the displacement goes farthest;
/// what it does to the yaw counts by the mean lever of the points, NormalEquations::lever [m]. Pulls: of the points
/// that have any, ascending. Information: ∂²L/∂x², which counts in the directions that are seen.
DecisivePlace decisivePlace(const std::vector<PointPull>& pulls, const ScannedPoints& current,
                            const Eigen::Matrix3d& information, const ObservableDirections& seen, double lever,
                            double size);

}  // namespace sckf
