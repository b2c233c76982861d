#include "sckf_odometry/pipeline/feature.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sckf {

namespace {

constexpr double kSameAngle = 0.3;  // [rad] between the walls of a corner, and between frames
constexpr double kSamePlace = 0.3;  // [m]
constexpr double kHidden = 0.3;     // [m] a beam that ends so much before it does not reach it

Eigen::Vector2d pointOf(const Feature& line, double along) { return line.frame * Eigen::Vector2d(along, 0.0); }

/// The ends of a line along the x axis of another one.
std::pair<double, double> endsAlong(const Feature& axis, const Feature& line) {
  const SE2 axis_from_world = inverse(axis.frame);
  return std::minmax(
      {(axis_from_world * pointOf(line, line.shape.from)).x(), (axis_from_world * pointOf(line, line.shape.to)).x()});
}

Eigen::Vector2d laserOf(const ScannedPoints& points) {
  return points.point.front() - points.range.front() * points.ray.front();
}

}  // namespace

FeatureSight::FeatureSight(const Corner& corner)
    : sighting{corner.base_from_corner, corner.covariance},
      shape{false, corner.angle},
      first(corner.first),
      last(corner.last),
      every(1) {}

FeatureSight::FeatureSight(const Line& line)
    : sighting{line.base_from_line, line.covariance, true},
      shape{true, 0.0, line.from, line.to},
      first(line.first),
      last(line.last),
      every(line.every) {}

double FeatureSight::farthest() const {
  return std::max(pointOf(feature(), shape.from).norm(), pointOf(feature(), shape.to).norm());
}

double distance(const Feature& a, const Feature& b) {
  if (!a.shape.is_line) return (a.frame.translation() - b.frame.translation()).norm();
  return std::abs((inverse(a.frame) * pointOf(b, 0.5 * (b.shape.from + b.shape.to))).y());
}

bool lieSideBySide(const Feature& a, const Feature& b) {
  const auto [from, to] = endsAlong(a, b);
  const double common = std::min(a.shape.to, to) - std::max(a.shape.from, from);
  return common >= 0.5 * std::min(a.shape.to - a.shape.from, to - from);
}

bool areOfAKind(const Feature& a, const Feature& b) {
  if (a.shape.is_line != b.shape.is_line) return false;
  return a.shape.is_line ? lieSideBySide(a, b) : std::abs(a.shape.angle - b.shape.angle) <= kSameAngle;
}

bool areAlike(const Feature& a, const Feature& b) {
  const double turned = std::abs(wrapAngle(a.frame.yaw - b.frame.yaw));
  return areOfAKind(a, b) && distance(a, b) < kSamePlace && turned < kSameAngle;
}

void grow(Feature& line, const Feature& other) {
  const auto [from, to] = endsAlong(line, other);
  line.shape.from = std::min(line.shape.from, from);
  line.shape.to = std::max(line.shape.to, to);
}

bool isCornerInView(const SE2& base_from_corner, const ScannedPoints& points, double farthest) {
  constexpr double kBeamWidth = 0.035;  // [rad]
  if (points.size() == 0) return false;
  const Eigen::Vector2d to_corner = base_from_corner.translation() - laserOf(points);
  const double distance = to_corner.norm();
  if (distance > farthest) return false;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool is_on_beam = points.ray[i].dot(to_corner) > std::cos(kBeamWidth) * distance;
    if (is_on_beam && points.range[i] > distance - kHidden) return true;
  }
  return false;
}

double stretchInView(const Feature& line, const ScannedPoints& points, const std::vector<bool>& aside,
                     double farthest) {
  if (points.size() == 0) return 0.0;
  const SE2 line_from_base = inverse(line.frame);
  const Eigen::Vector2d laser = line_from_base * laserOf(points);
  const auto reaches = [&](std::size_t i, const Eigen::Vector2d& ray, double along) {
    const double distance = -laser.y() / ray.y();
    const bool meets = laser.y() > 0.0 && ray.y() < 0.0 && along >= line.shape.from && along <= line.shape.to;
    return meets && distance <= farthest && points.range[i] > distance - kHidden && !aside[i];
  };
  double longest = 0.0;
  double begin = 0.0;
  bool goes_on = false;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d ray = line_from_base.rotation() * points.ray[i];
    const double along = laser.x() - laser.y() / ray.y() * ray.x();
    const bool went_on = std::exchange(goes_on, reaches(i, ray, along));
    if (!went_on) begin = along;
    if (goes_on) longest = std::max(longest, std::abs(along - begin));
  }
  return longest;
}

}  // namespace sckf
