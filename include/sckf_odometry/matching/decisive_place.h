// The one place that decides most of what two scans tell: the only door frame in sight along a corridor, or somebody
// who walks there.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "sckf_odometry/matching/alignment_problem.h"
#include "sckf_odometry/matching/observability.h"

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

/// Of all places, points no farther than size [m] from one of them, the one with which the displacement goes farthest,
/// points and weights as they are in the problem at x; what it does to the yaw counts by the mean lever of the points.
/// Directions that are not seen do not count. The lever: NormalEquations::lever [m].
DecisivePlace decisivePlace(const AlignmentProblem& problem, const SE2& x, const ObservableDirections& seen,
                            double lever, double size);

}  // namespace sckf
