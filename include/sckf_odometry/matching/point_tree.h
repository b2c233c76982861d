// The nearest of many points.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <vector>

namespace sckf {

/// Points in a k-d tree (nanoflann). Copies share it.
class PointTree {
 public:
  PointTree() = default;  ///< of no points
  explicit PointTree(std::vector<Eigen::Vector2d> points);

  struct Answer {
    bool found = false;       ///< whether a point is that near
    std::size_t nearest = 0;  ///< its index
    double distance = 0.0;    ///< to it; if there is none, how far at least all are [m]
    double next = 0.0;        ///< so far at least are all others [m]
  };

  /// The nearest of the points that are less than `within` [m] from one.
  Answer nearest(const Eigen::Vector2d& point, double within) const;

 private:
  struct Index;
  std::shared_ptr<const Index> index_;
};

}  // namespace sckf
