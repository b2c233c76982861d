// Straight lines through stretches of a scan.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sckf_odometry/matching/surface.h"

namespace sckf {

/// Running sums over the points, so that the line through any stretch of them costs O(1).
class LineFits {
 public:
  explicit LineFits(const std::vector<Eigen::Vector2d>& points);

  struct Fit {
    Surface surface;
    double scatter;  ///< std of the points across the line [m]
  };

  /// The total least squares line through the points first … last.
  Fit fit(int first, int last) const;

 private:
  using Sums = Eigen::Matrix<double, 5, 1>;
  std::vector<Sums> sums_;
};

/// How a fitted line changes with the range of any point that it was fitted to.
class LineByRange {
 public:
  LineByRange(const Surface& line, const ScannedPoints& points)
      : points_(points), centroid_(line.centroid), shift_by_ray_(line.normal / line.size()) {
    const Eigen::Matrix2d across_along = line.normal * line.tangent().transpose();
    turn_by_ray_ = -(across_along + across_along.transpose()) / line.spread;
  }

  /// The angle of its normal [rad/m] …
  double turn(int point) const {
    const auto k = static_cast<std::size_t>(point);
    return points_.ray[k].dot(turn_by_ray_ * (points_.point[k] - centroid_));
  }

  /// … and its centroid, across it.
  double shift(int point) const { return shift_by_ray_.dot(points_.ray[static_cast<std::size_t>(point)]); }

 private:
  const ScannedPoints& points_;
  Eigen::Vector2d centroid_;
  Eigen::Vector2d shift_by_ray_;
  Eigen::Matrix2d turn_by_ray_;
};

/// Whether the points i and i + 1 can lie on one surface: no farther apart than on a surface seen at a grazing angle
/// (the adaptive breakpoint of Borges and Aldon).
bool connected(const ScannedPoints& points, std::size_t i, double range_noise, double angle_increment);

/// The points between begin and end at which a connected stretch bends, in order: those that lie farthest from the line
/// through the ends, while that is more than `most` (iterative end point fit).
std::vector<int> bends(const std::vector<Eigen::Vector2d>& points, int begin, int end, double most);

}  // namespace sckf
