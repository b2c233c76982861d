#include "sckf_odometry/matching/corners.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "sckf_odometry/core/covariance.h"
#include "sckf_odometry/matching/line_fit.h"

namespace sckf {

namespace {

/// Beyond this the lines meet somewhere else than the walls do [m].
constexpr double kMaxGap = 0.2;

class CornerSearch {
 public:
  CornerSearch(const PreparedScan& scan, const CornerOptions& options)
      : scan_(scan), points_(scan.points), fits_(scan.points.point), options_(options) {}

  std::vector<Corner> run() {
    const int n = static_cast<int>(points_.size());
    for (int begin = 0, end = 0; begin < n; begin = end + 1) {
      end = begin;
      while (end + 1 < n && connected(points_, index(end), scan_.range_noise, scan_.angle_increment)) ++end;
      searchStretch(begin, end);
    }
    return corners_;
  }

 private:
  static std::size_t index(int i) { return static_cast<std::size_t>(i); }
  const Eigen::Vector2d& point(int i) const { return points_.point[index(i)]; }

  /// Splits the stretch where it bends; a wall between two bends is shared out in the middle.
  void searchStretch(int begin, int end) {
    const double most = 3.0 * std::hypot(scan_.range_noise, options_.roughness);
    const std::vector<int> at = bends(points_.point, begin, end, most);
    for (std::size_t k = 0; k < at.size(); ++k) {
      const int from = k > 0 ? (at[k - 1] + at[k]) / 2 + 1 : begin;
      const int to = k + 1 < at.size() ? (at[k] + at[k + 1]) / 2 : end;
      if (const auto corner = cornerAt(at[k], from, to)) corners_.push_back(*corner);
    }
  }

  /// The corner at the bend between two walls, the points of which lie within [begin, end].
  std::optional<Corner> cornerAt(int bend, int begin, int end) const {
    const int first = farthestWithin(bend, begin, -1);
    const int last = farthestWithin(bend, end, 1);
    const int at = refined(bend, first, last);
    // The point at the bend may lie on either wall, or on both: it is set aside, and in neither fit.
    const auto one = wall(at - 1, first);
    const auto other = wall(at + 1, last);
    if (!one || !other) return std::nullopt;
    return meeting(*one, *other, at);
  }

  int farthestWithin(int bend, int end, int step) const {
    int i = bend;
    while (i != end && (point(i + step) - point(bend)).norm() <= options_.max_length) i += step;
    return i;
  }

  /// Noise moves the farthest point; where both walls are straightest is where they meet.
  int refined(int bend, int first, int last) const {
    constexpr int kReach = 3;
    const auto squares = [this](int from, int to) {
      const double scatter = fits_.fit(from, to).scatter;
      return scatter * scatter * (to - from - 1);
    };
    int best = bend;
    double least = std::numeric_limits<double>::infinity();
    for (int i = std::max(bend - kReach, first + 4); i <= std::min(bend + kReach, last - 4); ++i) {
      const double sum = squares(first, i - 1) + squares(i + 1, last);
      if (sum >= least) continue;
      least = sum;
      best = i;
    }
    return best;
  }

  /// The longest straight stretch that begins at the bend and does not reach beyond `farthest`.
  std::optional<Surface> wall(int bend, int farthest) const {
    const int step = farthest < bend ? -1 : 1;
    const double most = std::hypot(options_.straightness * scan_.range_noise, options_.roughness);
    for (int i = farthest; (i - bend) * step + 1 >= options_.min_points; i -= step) {
      if ((point(i) - point(bend)).norm() < options_.min_length) break;
      const LineFits::Fit fit = fits_.fit(std::min(bend, i), std::max(bend, i));
      if (fit.scatter <= most) return fit.surface;
    }
    return std::nullopt;
  }

  std::optional<Corner> meeting(const Surface& one, const Surface& other, int bend) const {
    Eigen::Matrix2d N;
    N << one.normal.transpose(), other.normal.transpose();
    if (std::abs(N.determinant()) < std::sin(options_.min_angle)) return std::nullopt;
    const Eigen::Matrix2d solve = N.inverse();
    const Eigen::Vector2d meet =
        solve * Eigen::Vector2d(one.normal.dot(one.centroid), other.normal.dot(other.centroid));
    if ((meet - point(bend)).norm() > kMaxGap) return std::nullopt;

    const double yaw_one = direction(one.centroid - meet, one);
    const double yaw_other = direction(other.centroid - meet, other);
    const double between = wrapAngle(yaw_other - yaw_one);
    Corner corner;
    corner.base_from_corner = SE2(meet.x(), meet.y(), yaw_one + 0.5 * between);
    corner.angle = std::abs(between);
    corner.first = one.first;
    corner.last = other.last;
    corner.by_range = Eigen::Matrix3Xd::Zero(3, corner.last - corner.first + 1);
    addDerivatives(one, solve.col(0), corner);
    addDerivatives(other, solve.col(1), corner);
    const Eigen::Vector3d off(options_.std_position, options_.std_position, options_.std_yaw);
    corner.covariance =
        symmetric(scan_.range_noise * scan_.range_noise * corner.by_range * corner.by_range.transpose());
    corner.covariance.diagonal() += off.cwiseAbs2();
    return corner;
  }

  /// Of the wall, away from the corner.
  static double direction(const Eigen::Vector2d& away, const Surface& wall) {
    const Eigen::Vector2d t = wall.tangent().dot(away) > 0.0 ? wall.tangent() : Eigen::Vector2d(-wall.tangent());
    return std::atan2(t.y(), t.x());
  }

  /// Of nᵀ(meet − c) = 0, which holds for either wall: nᵀ δmeet = nᵀ δc − δn (meet − c), and the yaw is the mean of
  /// both.
  void addDerivatives(const Surface& wall, const Eigen::Vector2d& meet_by_offset, Corner& corner) const {
    const double along = wall.tangent().dot(corner.base_from_corner.translation() - wall.centroid);
    const LineByRange by_range(wall, points_);
    for (int i = wall.first; i <= wall.last; ++i) {
      const double turn = by_range.turn(i);
      auto column = corner.by_range.col(i - corner.first);
      column.head<2>() = meet_by_offset * (by_range.shift(i) - turn * along);
      column.z() = 0.5 * turn;
    }
  }

  const PreparedScan& scan_;
  const ScannedPoints& points_;
  LineFits fits_;
  const CornerOptions& options_;
  std::vector<Corner> corners_;
};

}  // namespace

std::vector<Corner> findCorners(const PreparedScan& scan, const CornerOptions& options) {
  return CornerSearch(scan, options).run();
}

}  // namespace sckf
