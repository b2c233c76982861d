#include "sckf_odometry/matching/lines.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

#include "sckf_odometry/core/covariance.h"
#include "sckf_odometry/matching/line_fit.h"

namespace sckf {

namespace {

class LineSearch {
 public:
  LineSearch(const PreparedScan& scan, const std::vector<bool>& taken, const LineOptions& options)
      : scan_(scan),
        points_(scan.points),
        taken_(taken),
        fits_(scan.points.point),
        options_(options),
        farthest_(3.0 * std::hypot(scan.range_noise, options.roughness)),
        scatter_(std::hypot(options.straightness * scan.range_noise, options.roughness)) {}

  std::vector<Line> run() {
    const int n = static_cast<int>(points_.size());
    for (int begin = 0, end = 0; begin < n; begin = end + 1) {
      end = begin;
      if (taken_[index(begin)]) continue;
      while (end + 1 < n && goesOn(end)) ++end;
      searchStretch(begin, end);
    }
    return lines_;
  }

 private:
  static std::size_t index(int i) { return static_cast<std::size_t>(i); }

  bool goesOn(int i) const {
    return !taken_[index(i + 1)] && connected(points_, index(i), scan_.range_noise, scan_.angle_increment);
  }

  /// A point at a bend may lie on either wall, or on both: it is in neither fit. Noise bends walls, too: pieces that
  /// are straight together are one.
  void searchStretch(int begin, int end) {
    std::vector<int> ends = bends(points_.point, begin, end, farthest_);
    ends.push_back(end + 1);
    int first = begin;
    for (std::size_t k = 0; k < ends.size(); ++k) {
      const bool is_last = k + 1 == ends.size();
      if (!is_last && straight(first, ends[k + 1] - 1)) continue;
      if (const auto wall = straight(first, ends[k] - 1)) add(*wall);
      first = ends[k] + 1;
    }
  }

  std::optional<Surface> straight(int first, int last) const {
    if (last - first + 1 < 3) return std::nullopt;
    const LineFits::Fit fit = fits_.fit(first, last);
    if (fit.scatter > scatter_) return std::nullopt;
    for (int i = first; i <= last; ++i) {
      if (std::abs(fit.surface.normal.dot(points_.point[index(i)] - fit.surface.centroid)) > farthest_) return {};
    }
    return fit.surface;
  }

  void add(const Surface& wall) {
    const Eigen::Vector2d between_ends = points_.point[index(wall.last)] - points_.point[index(wall.first)];
    const bool is_long = std::abs(wall.tangent().dot(between_ends)) >= options_.min_length;
    if (is_long && wall.size() >= options_.min_points) lines_.push_back(lineOf(wall));
  }

  /// A wall is known by few points as well as by all, since it is not quite straight: the others are left to the match,
  /// which would be lost without the wall that fills half of the view.
  Line lineOf(const Surface& wall) const {
    Line line;
    line.every = std::max(2, wall.size() / options_.points);
    line.first = wall.first;
    line.last = wall.last - (wall.last - wall.first) % line.every;
    const ScannedPoints points = pointsOf(line);
    const int n = static_cast<int>(points.size());
    const Surface fitted = LineFits(points.point).fit(0, n - 1).surface;
    const double sign = fitted.normal.dot(points.ray.front()) > 0.0 ? -1.0 : 1.0;
    const Eigen::Vector2d y = sign * fitted.normal;
    const Eigen::Vector2d x(y.y(), -y.x());
    const auto along = [&](int i) { return x.dot(points_.point[index(i)] - fitted.centroid); };
    line.base_from_line = SE2(fitted.centroid.x(), fitted.centroid.y(), std::atan2(x.y(), x.x()));
    std::tie(line.from, line.to) = std::minmax({along(wall.first), along(wall.last)});
    const LineByRange by_range(fitted, points);
    line.by_range.resize(3, n);
    for (int i = 0; i < n; ++i) {
      line.by_range.col(i).head<2>() = fitted.normal * by_range.shift(i);
      line.by_range.col(i).z() = by_range.turn(i);
    }
    line.covariance = scan_.range_noise * scan_.range_noise * line.by_range * line.by_range.transpose();
    line.covariance.topLeftCorner<2, 2>() += options_.std_offset * options_.std_offset * y * y.transpose();
    line.covariance(2, 2) += options_.std_yaw * options_.std_yaw;
    line.covariance = symmetric(line.covariance);
    return line;
  }

  ScannedPoints pointsOf(const Line& line) const {
    ScannedPoints points;
    for (int i = line.first; i <= line.last; i += line.every) {
      points.beam.push_back(points_.beam[index(i)]);
      points.range.push_back(points_.range[index(i)]);
      points.ray.push_back(points_.ray[index(i)]);
      points.point.push_back(points_.point[index(i)]);
    }
    return points;
  }

  const PreparedScan& scan_;
  const ScannedPoints& points_;
  const std::vector<bool>& taken_;
  LineFits fits_;
  const LineOptions& options_;
  double farthest_;  // [m] from straight: beyond, it bends
  double scatter_;   // [m] of the points of a straight wall
  std::vector<Line> lines_;
};

}  // namespace

std::vector<Line> findLines(const PreparedScan& scan, const std::vector<bool>& taken, const LineOptions& options) {
  return LineSearch(scan, taken, options).run();
}

}  // namespace sckf
