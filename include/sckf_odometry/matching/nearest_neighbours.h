// Which points of two scans belong together: the nearest, while one scan is moved little by little over the other.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "sckf_odometry/core/se2.h"
#include "sckf_odometry/matching/prepared_scan.h"

namespace sckf {

/// A point of the current scan and its nearest point of the reference scan: indices of points, not of beams.
struct Pair {
  int reference = 0;
  int current = 0;
};

/// The nearest points by the tree of the reference. It is asked about a point, and not again until that has moved by
/// half of what one is nearer than all others, or may have come near enough to any: until then it would tell the same,
/// and most steps of an alignment are smaller. Both scans must outlive this.
class NearestNeighbours {
 public:
  NearestNeighbours(const PreparedScan& reference, const PreparedScan& current);

  /// In the order of the current scan's points, those that are at most max_distance [m] from their nearest.
  std::vector<Pair> pairs(const RigidMotion& reference_from_current, double max_distance);

  /// How often the tree has been asked so far.
  std::size_t queries() const { return queries_; }

 private:
  /// What the tree told of a point.
  struct Nearest {
    Eigen::Vector2d asked_at = Eigen::Vector2d::Zero();  // in the frame of the reference
    int reference = 0;
    double distance = 0.0;       // [m]
    double valid_within = -1.0;  // [m] of where it was asked; negative: nothing is known
  };

  void ask(const Eigen::Vector2d& point, double within, Nearest& nearest);

  const PreparedScan& reference_;
  const PreparedScan& current_;
  std::vector<Nearest> nearest_;  // of each current point
  std::size_t queries_ = 0;
};

}  // namespace sckf
