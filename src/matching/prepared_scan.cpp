#include "sckf_odometry/matching/prepared_scan.h"

#include <mrpt/maps/CSimplePointsMap.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <sstream>

namespace sckf {

namespace {

/// Largest tilt of the plane of the laser against the x-y plane of base_link: beyond, its points are no floor plan.
constexpr double kMaxTilt = 20.0 * M_PI / 180.0;

/// What stands so much in front of what a beam has seen may still be a part of it [m], and [std of a range].
constexpr double kDepth = 0.15;
constexpr double kDepthInNoise = 4.0;

/// The median of the absolute values, scaled to the standard deviation of a Gaussian.
double robustStd(std::vector<double> values) {
  constexpr double kGaussian = 1.4826;
  for (double& v : values) v = std::abs(v);
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return kGaussian * *middle;
}

/// Noise of a range from the scan itself. On a straight surface 1/r is a sinusoid of the bearing, so that each range is
/// known from its two neighbours, r̂ = 2 cos Δ / (1/r₋ + 1/r₊), with variance σ²/2 where the three are about equal.
double estimateRangeNoise(const ScannedPoints& points, double angle_increment, const ScanOptions& options) {
  std::vector<double> deviations;
  deviations.reserve(points.size());
  for (std::size_t i = 1; i + 1 < points.size(); ++i) {
    if (points.beam[i + 1] - points.beam[i - 1] != 2) continue;
    const double expected = 2.0 * std::cos(angle_increment) / (1.0 / points.range[i - 1] + 1.0 / points.range[i + 1]);
    deviations.push_back((points.range[i] - expected) / std::sqrt(1.5));
  }
  if (deviations.empty()) return options.range_noise_max;
  return std::clamp(robustStd(std::move(deviations)), options.range_noise_min, options.range_noise_max);
}

bool anglesAreSensible(const LaserScan& scan) {
  constexpr double kTurn = 2.0 * M_PI;
  const double fan = std::abs(scan.angle_increment) * static_cast<double>(scan.ranges.size());
  return std::abs(scan.angle_min) <= 2.0 * kTurn && scan.angle_increment != 0.0 && fan <= 1.1 * kTurn;
}

bool mountIsSensible(const Eigen::Isometry3d& base_from_laser) {
  constexpr double kFarthest = 100.0;  // [m]
  return base_from_laser.matrix().allFinite() && base_from_laser.translation().norm() <= kFarthest;
}

/// What makes the geometry of a scan unusable, or nothing.
std::string geometryProblem(const LaserScan& scan, const Eigen::Isometry3d& base_from_laser) {
  std::ostringstream problem;
  if (!anglesAreSensible(scan)) {
    problem << "angle_min is " << scan.angle_min << ", angle_increment " << scan.angle_increment << " with "
            << scan.ranges.size() << " ranges: expected values in rad, an increment that is not zero and beams within "
            << "one turn";
  } else if (!(scan.range_min < scan.range_max)) {
    problem << "range_min is " << scan.range_min << ", range_max " << scan.range_max
            << ": expected range_min below range_max [m]";
  } else if (!mountIsSensible(base_from_laser)) {
    problem << "the laser's mount is at (" << base_from_laser.translation().transpose()
            << "): expected a finite pose within 100 m of the base";
  } else if (std::abs(base_from_laser.linear()(2, 2)) < std::cos(kMaxTilt)) {
    problem << "the laser's plane is tilted against the x-y plane of the base by "
            << std::acos(std::abs(base_from_laser.linear()(2, 2))) * 180.0 / M_PI << " deg: expected at most "
            << kMaxTilt * 180.0 / M_PI;
  }
  return problem.str();
}

/// Every k-th beam from one on.
LaserScan everyBeam(std::size_t k, std::size_t first, const LaserScan& scan) {
  LaserScan thin = scan;
  thin.angle_min += static_cast<double>(first) * scan.angle_increment;
  thin.angle_increment *= static_cast<double>(k);
  thin.time_increment *= static_cast<double>(k);
  thin.ranges.clear();
  for (std::size_t i = first; i < scan.ranges.size(); i += k) thin.ranges.push_back(scan.ranges[i]);
  return thin;
}

/// So that no more are left than allowed: time and memory are proportional to them.
LaserScan thinned(const LaserScan& scan, std::size_t max_beams) {
  return everyBeam((scan.ranges.size() + max_beams - 1) / max_beams, 0, scan);
}

/// Drivers that fill a finer grid than their laser has leave all but every k-th beam empty. Those that are no beams
/// would hide that the others are neighbours: the scan without them, if there are such.
std::optional<LaserScan> withoutEmptyBeams(const LaserScan& scan) {
  constexpr std::size_t kFewest = 20;  // by chance as few may lie in such a pattern
  std::size_t first = scan.ranges.size();
  std::size_t k = 0;
  std::size_t read = 0;
  for (std::size_t i = 0; i < scan.ranges.size() && k != 1; ++i) {
    if (!std::isfinite(scan.ranges[i]) || scan.ranges[i] <= 0.0F) continue;
    first = std::min(first, i);
    k = std::gcd(k, i - first);
    ++read;
  }
  if (k <= 1 || read < kFewest || 2 * read * k < scan.ranges.size()) return std::nullopt;
  return everyBeam(k, first % k, scan);
}

/// What beam i measured, from where the robot was then to where it was at the stamp: p ← C(φ_i) p + t_i, and the rays
/// with it. stamp_from_base_at: by the beam.
template <typename StampFromBaseAt>
void undo(const StampFromBaseAt& stamp_from_base_at, ScannedPoints& points) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const RigidMotion stamp_from_base(stamp_from_base_at(points.beam[i]));
    points.point[i] = stamp_from_base * points.point[i];
    points.ray[i] = stamp_from_base.C * points.ray[i];
  }
}

/// Of the beams of a scan: -1/2 the first, 1/2 the last.
double shareOf(int beam, std::size_t beams) { return beam / static_cast<double>(beams - 1) - 0.5; }

ScannedPoints readings(const LaserScan& scan, const Eigen::Isometry3d& base_from_laser, double range_min,
                       double range_max, double offset) {
  const Eigen::Vector2d origin = base_from_laser.translation().head<2>();
  ScannedPoints points;
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    const auto told = static_cast<double>(scan.ranges[i]);
    const double range = told + offset;
    if (!isReading(told, range_min, range_max) || !(range > 0.0)) continue;
    const double bearing = scan.angle_min + static_cast<double>(i) * scan.angle_increment;
    const Eigen::Vector3d ray = base_from_laser.linear() * Eigen::Vector3d(std::cos(bearing), std::sin(bearing), 0.0);
    points.beam.push_back(static_cast<int>(i));
    points.range.push_back(range);
    points.ray.emplace_back(ray.head<2>());
    points.point.emplace_back(origin + range * ray.head<2>());
  }
  return points;
}

/// Surfaces, tree and map of the points.
void describe(PreparedScan& scan, const SurfaceOptions& options) {
  scan.surface = fitSurfaces(scan.points, scan.range_noise, scan.angle_increment, options);
  scan.tree = PointTree(scan.points.point);
  const auto map = std::make_shared<mrpt::maps::CSimplePointsMap>();
  map->reserve(scan.size());
  for (const Eigen::Vector2d& p : scan.points.point) {
    map->insertPointFast(static_cast<float>(p.x()), static_cast<float>(p.y()), 0.0F);
  }
  scan.map = map;
}

}  // namespace

Eigen::VectorXd PreparedScan::rangeVariances() const {
  return Eigen::VectorXd::Constant(static_cast<Eigen::Index>(beams), range_noise * range_noise);
}

Eigen::Vector2d PreparedScan::bySweepDuration(std::size_t i) const {
  const Eigen::Vector2d velocity = sweep.twist.head<2>() + sweep.twist.z() * quarterTurn(points.point[i]);
  return shareOf(points.beam[i], beams) * velocity;
}

std::shared_ptr<const PreparedScan> prepareScan(const LaserScan& scan, const Eigen::Isometry3d& base_from_laser,
                                                const ScanOptions& options, std::string* rejection,
                                                const ScanMotion& motion) {
  const auto reject = [rejection](const std::string& reason) {
    if (rejection != nullptr) *rejection = reason;
    return nullptr;
  };
  const std::string problem = geometryProblem(scan, base_from_laser);
  if (!problem.empty()) return reject(problem);
  const auto max_beams = static_cast<std::size_t>(std::max(1, options.max_beams));
  if (const std::optional<LaserScan> dense = withoutEmptyBeams(scan)) {
    return prepareScan(*dense, base_from_laser, options, rejection, motion);
  }
  if (scan.ranges.size() > max_beams) {
    return prepareScan(thinned(scan, max_beams), base_from_laser, options, rejection, motion);
  }

  auto prepared = std::make_shared<PreparedScan>();
  prepared->stamp = scan.stamp;
  prepared->beams = scan.ranges.size();
  const double range_min = std::max(options.range_min, scan.range_min);
  const double range_max = std::min(options.range_max, scan.range_max);
  prepared->points = readings(scan, base_from_laser, range_min, range_max, options.range_offset);
  if (!motion.atRest()) {
    undo([&](int beam) { return motion.at(beam * scan.time_increment); }, prepared->points);
  } else if (prepared->beams > 1) {
    const EvenSweep& sweep = options.sweep;
    prepared->sweep = sweep;
    const bool moves = sweep.duration != 0.0 && !sweep.twist.isZero(0.0);
    if (moves) undo([&](int beam) { return sweep.at(shareOf(beam, prepared->beams)); }, prepared->points);
  }
  if (prepared->size() < static_cast<std::size_t>(options.min_points)) {
    std::ostringstream reason;
    reason << prepared->size() << " of " << scan.ranges.size() << " ranges are finite and within [" << range_min << ", "
           << range_max << ") m: expected at least " << options.min_points;
    return reject(reason.str());
  }
  prepared->angle_increment = scan.angle_increment;
  prepared->range_offset = options.range_offset;
  prepared->range_noise = estimateRangeNoise(prepared->points, scan.angle_increment, options);
  prepared->free_space =
      FreeSpace(scan, base_from_laser, prepared->points, std::max(kDepth, kDepthInNoise * prepared->range_noise));
  describe(*prepared, options.surface);
  return prepared;
}

std::shared_ptr<const PreparedScan> setAside(const PreparedScan& scan, const std::vector<bool>& aside,
                                             const SurfaceOptions& options) {
  auto rest = std::make_shared<PreparedScan>();
  rest->stamp = scan.stamp;
  rest->beams = scan.beams;
  rest->angle_increment = scan.angle_increment;
  rest->range_noise = scan.range_noise;
  rest->range_offset = scan.range_offset;
  rest->sweep = scan.sweep;
  rest->free_space = scan.free_space;
  rest->set_aside = scan.set_aside;
  for (std::size_t i = 0; i < scan.size(); ++i) {
    if (aside[i]) {
      rest->set_aside.push_back(scan.points.point[i]);
      continue;
    }
    rest->points.beam.push_back(scan.points.beam[i]);
    rest->points.range.push_back(scan.points.range[i]);
    rest->points.ray.push_back(scan.points.ray[i]);
    rest->points.point.push_back(scan.points.point[i]);
  }
  describe(*rest, options);
  return rest;
}

}  // namespace sckf
