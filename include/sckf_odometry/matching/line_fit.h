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

/// How a fitted line changes with the range of point i, which it was fitted to: the angle of its normal [rad/m] …
inline double turnByRange(const Surface& line, const ScannedPoints& points, int i) {
  const auto k = static_cast<std::size_t>(i);
  const Eigen::Vector2d d = points.point[k] - line.centroid;
  const Eigen::Vector2d& n = line.normal;
  const Eigen::Vector2d tangent = line.tangent();
  return -(tangent.dot(points.ray[k]) * n.dot(d) + tangent.dot(d) * n.dot(points.ray[k])) / line.spread;
}

/// … and its centroid, across it.
inline double shiftByRange(const Surface& line, const ScannedPoints& points, int i) {
  return line.normal.dot(points.ray[static_cast<std::size_t>(i)]) / line.size();
}

/// Whether the points i and i + 1 can lie on one surface: no farther apart than on a surface seen at a grazing angle
/// (the adaptive breakpoint of Borges and Aldon).
bool connected(const ScannedPoints& points, std::size_t i, double range_noise, double angle_increment);

/// The points between begin and end at which a connected stretch bends, in order: those that lie farthest from the line
/// through the ends, while that is more than `most` (iterative end point fit).
std::vector<int> bends(const std::vector<Eigen::Vector2d>& points, int begin, int end, double most);

}  // namespace sckf
