#include "sckf_odometry/matching/point_tree.h"

#include <algorithm>
#include <cmath>
#include <nanoflann.hpp>
#include <utility>

namespace sckf {

namespace {

/// As nanoflann asks for them.
struct Points {
  std::vector<Eigen::Vector2d> points;

  std::size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(std::size_t i, std::size_t axis) const { return points[i](static_cast<Eigen::Index>(axis)); }
  /// The square of it: nanoflann before 1.3, as MRPT of Debian 11 has it within, asks for that, too.
  double kdtree_distance(const double* from, std::size_t i, std::size_t /*dimensions*/) const {
    return (points[i] - Eigen::Vector2d(from[0], from[1])).squaredNorm();
  }
  template <class Box>
  bool kdtree_get_bbox(Box& /*box*/) const {
    return false;
  }
};

/// The two nearest so far, as nanoflann tells of points: those that are nearer than the worst. Its own result sets know
/// either how many are wanted or how near.
struct TwoNearest {
  using DistanceType = double;
  using IndexType = std::size_t;

  std::size_t nearest = 0;
  double square = 0.0;  // of the distance to it
  double next_square = 0.0;
  std::size_t found = 0;

  explicit TwoNearest(double square_within) : square(square_within), next_square(square_within) {}

  std::size_t size() const { return found; }
  bool full() const { return found >= 2; }
  double worstDist() const { return next_square; }
  void sort() {}
  bool addPoint(double square_of_point, std::size_t point) {
    ++found;
    next_square = std::min(next_square, std::max(square, square_of_point));
    if (square_of_point < square) {
      square = square_of_point;
      nearest = point;
    }
    return true;
  }
};

}  // namespace

struct PointTree::Index {
  explicit Index(std::vector<Eigen::Vector2d> all) : points{std::move(all)}, tree(2, points) {
#if NANOFLANN_VERSION < 0x143  // newer ones have built it
    tree.buildIndex();
#endif
  }

  Points points;
  nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Points>, Points, 2, std::size_t> tree;
};

PointTree::PointTree(std::vector<Eigen::Vector2d> points) {
  if (!points.empty()) index_ = std::make_shared<const Index>(std::move(points));
}

PointTree::Answer PointTree::nearest(const Eigen::Vector2d& point, double within) const {
  TwoNearest two(within * within);
  if (index_) index_->tree.findNeighbors(two, point.data(), {});
  return {two.found > 0, two.nearest, std::sqrt(two.square), std::sqrt(two.next_square)};
}

}  // namespace sckf
