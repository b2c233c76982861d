#include "sckf_odometry/matching/line_fit.h"

#include <algorithm>
#include <cmath>

namespace sckf {

namespace {

void split(const std::vector<Eigen::Vector2d>& points, int begin, int end, double most, std::vector<int>& bends) {
  const auto point = [&points](int i) -> const Eigen::Vector2d& { return points[static_cast<std::size_t>(i)]; };
  const Eigen::Vector2d along = point(end) - point(begin);
  const bool is_ring = along.norm() <= most;  // which has no direction
  const Eigen::Vector2d normal = quarterTurn(along).normalized();
  int farthest = begin;
  double distance = most;
  for (int i = begin + 1; i < end; ++i) {
    const Eigen::Vector2d d = point(i) - point(begin);
    const double off = is_ring ? d.norm() : std::abs(normal.dot(d));
    if (off <= distance) continue;
    distance = off;
    farthest = i;
  }
  if (farthest == begin) return;
  split(points, begin, farthest, most, bends);
  bends.push_back(farthest);
  split(points, farthest, end, most, bends);
}

/// Unit vector at half the angle of v, which has that norm.
Eigen::Vector2d atHalfTheAngle(const Eigen::Vector2d& v, double norm) {
  if (norm == 0.0) return Eigen::Vector2d::UnitX();
  if (v.x() >= 0.0) return Eigen::Vector2d(norm + v.x(), v.y()).normalized();
  return Eigen::Vector2d(std::abs(v.y()), std::copysign(norm - v.x(), v.y())).normalized();
}

}  // namespace

LineFits::LineFits(const std::vector<Eigen::Vector2d>& points) : sums_(points.size() + 1, Sums::Zero()) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d& p = points[i];
    sums_[i + 1] = sums_[i];
    sums_[i + 1] += (Sums() << p.x(), p.y(), p.x() * p.x(), p.x() * p.y(), p.y() * p.y()).finished();
  }
}

LineFits::Fit LineFits::fit(int first, int last) const {
  const double n = last - first + 1;
  const Sums s = sums_[static_cast<std::size_t>(last) + 1] - sums_[static_cast<std::size_t>(first)];
  const Eigen::Vector2d c = s.head<2>() / n;
  const double xx = s(2) - n * c.x() * c.x();
  const double xy = s(3) - n * c.x() * c.y();
  const double yy = s(4) - n * c.y() * c.y();
  const Eigen::Vector2d doubled(0.5 * (xx - yy), xy);  // points along twice the angle of the line
  const double half_spread = doubled.norm();
  const double across = std::max(0.0, 0.5 * (xx + yy) - half_spread);
  return {{c, quarterTurn(atHalfTheAngle(doubled, half_spread)), first, last, 2.0 * half_spread},
          std::sqrt(across / std::max(1.0, n - 2.0))};
}

bool connected(const ScannedPoints& points, std::size_t i, double range_noise, double angle_increment) {
  constexpr double kGrazing = 8.0 * M_PI / 180.0;
  constexpr int kMaxBeams = 3;
  const int beams = points.beam[i + 1] - points.beam[i];
  const double step = beams * std::abs(angle_increment);
  if (beams > kMaxBeams || step >= kGrazing) return false;
  const double reach = points.range[i] * std::sin(step) / std::sin(kGrazing - step);
  return (points.point[i + 1] - points.point[i]).norm() <= reach + 3.0 * range_noise;
}

std::vector<int> bends(const std::vector<Eigen::Vector2d>& points, int begin, int end, double most) {
  std::vector<int> bends;
  split(points, begin, end, most, bends);
  return bends;
}

}  // namespace sckf
