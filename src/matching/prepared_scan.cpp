#include "sckf_odometry/matching/prepared_scan.h"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace sckf {

namespace {

/// Largest tilt of the plane of the laser against the x-y plane of base_link: beyond, its points are no floor plan.
constexpr double kMaxTilt = 20.0 * M_PI / 180.0;

/// The median of the absolute values, scaled to the standard deviation of a Gaussian. Consumes its argument.
double robustStd(std::vector<double> values) {
  constexpr double kGaussian = 1.4826;
  for (double& v : values) v = std::abs(v);
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return kGaussian * *middle;
}

/// Noise of a range from the scan itself. On a straight surface 1/r is a sinusoid of the bearing, so that each range is
/// known from its two neighbours: r̂ = 2 cos Δ / (1/r₋ + 1/r₊), with variance σ²/2 where the three are about equal.
double estimateRangeNoise(const PreparedScan& scan, double angle_increment, const ScanOptions& options) {
  std::vector<double> deviations;
  deviations.reserve(scan.size());
  for (std::size_t i = 1; i + 1 < scan.size(); ++i) {
    if (scan.beam[i + 1] - scan.beam[i - 1] != 2) continue;
    const double expected = 2.0 * std::cos(angle_increment) / (1.0 / scan.range[i - 1] + 1.0 / scan.range[i + 1]);
    deviations.push_back((scan.range[i] - expected) / std::sqrt(1.5));
  }
  if (deviations.size() < options.min_points / 2) return options.range_noise_max;
  return std::clamp(robustStd(std::move(deviations)), options.range_noise_min, options.range_noise_max);
}

/// Running sums over the points, so that the moments of any stretch of them cost O(1).
class Moments {
 public:
  explicit Moments(const std::vector<Eigen::Vector2d>& points) : sums_(points.size() + 1, Sums::Zero()) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2d& p = points[i];
      sums_[i + 1] = sums_[i];
      sums_[i + 1] += (Sums() << p.x(), p.y(), p.x() * p.x(), p.x() * p.y(), p.y() * p.y()).finished();
    }
  }

  /// The total least squares line through the points first … last.
  Surface fit(int first, int last) const {
    const double n = last - first + 1;
    const Sums s = sums_[static_cast<std::size_t>(last) + 1] - sums_[static_cast<std::size_t>(first)];
    Surface surface;
    surface.first = first;
    surface.last = last;
    surface.centroid = s.head<2>() / n;
    const double xx = s(2) - n * surface.centroid.x() * surface.centroid.x();
    const double xy = s(3) - n * surface.centroid.x() * surface.centroid.y();
    const double yy = s(4) - n * surface.centroid.y() * surface.centroid.y();
    const double half_difference = 0.5 * (xx - yy);
    const double half_spread = std::hypot(half_difference, xy);
    const double direction = 0.5 * std::atan2(xy, half_difference);
    surface.normal = {-std::sin(direction), std::cos(direction)};
    surface.spread = 2.0 * half_spread;
    surface.residual_std = std::sqrt(std::max(0.0, 0.5 * (xx + yy) - half_spread) / std::max(1.0, n - 2.0));
    return surface;
  }

 private:
  using Sums = Eigen::Matrix<double, 5, 1>;
  std::vector<Sums> sums_;
};

/// Whether two neighbouring points can lie on one surface: closer than a surface seen at a grazing angle allows
/// (Borges and Aldon's adaptive breakpoint).
bool connected(const PreparedScan& scan, std::size_t i, double angle_increment) {
  constexpr double kGrazing = 8.0 * M_PI / 180.0;
  const int beams = scan.beam[i + 1] - scan.beam[i];
  if (beams > 3) return false;
  const double step = beams * std::abs(angle_increment);
  if (step >= kGrazing) return false;
  const double reach = scan.range[i] * std::sin(step) / std::sin(kGrazing - step);
  return (scan.point[i + 1] - scan.point[i]).norm() <= reach + 3.0 * scan.range_noise;
}

/// The longest stretch around point i, within [begin, end], that noise alone keeps from being straight.
Surface growSurface(const PreparedScan& scan, const Moments& moments, int i, int begin, int end,
                    const ScanOptions& options) {
  const double tolerance = options.straightness * scan.range_noise;
  Surface best;
  for (const int half : {2, 3, 4, 6, 8, 11, 15, 20, 27, 36, 48, 64}) {
    const int first = std::max(begin, i - half);
    const int last = std::min(end, i + half);
    if (last - first < 3) continue;
    const Surface candidate = moments.fit(first, last);
    if (candidate.residual_std > tolerance) break;
    const double reach =
        (scan.point[static_cast<std::size_t>(last)] - scan.point[static_cast<std::size_t>(first)]).norm();
    best = candidate;
    if (reach > options.surface_length || (first == begin && last == end)) break;
  }
  return best;
}

/// A line that is hardly longer than its noise has no direction.
bool hasDirection(const Surface& surface, double range_noise, double max_angle_std) {
  return surface.valid() && range_noise < max_angle_std * std::sqrt(surface.spread);
}

void fitSurfaces(PreparedScan& scan, double angle_increment, const ScanOptions& options) {
  const Moments moments(scan.point);
  const int n = static_cast<int>(scan.size());
  scan.surface.resize(scan.size());
  for (int begin = 0, end = 0; begin < n; begin = end + 1) {
    end = begin;
    while (end + 1 < n && connected(scan, static_cast<std::size_t>(end), angle_increment)) ++end;
    for (int i = begin; i <= end; ++i) {
      const auto k = static_cast<std::size_t>(i);
      Surface surface = growSurface(scan, moments, i, begin, end, options);
      if (!hasDirection(surface, scan.range_noise, options.max_normal_std)) continue;
      if (surface.normal.dot(scan.ray[k]) > 0.0) surface.normal = -surface.normal;  // towards the laser
      scan.surface[k] = surface;
    }
  }
}

}  // namespace

Eigen::VectorXd PreparedScan::rangeVariances() const {
  return Eigen::VectorXd::Constant(static_cast<Eigen::Index>(beams), range_noise * range_noise);
}

std::shared_ptr<const PreparedScan> prepareScan(const LaserScan& scan, const Eigen::Isometry3d& base_from_laser,
                                                const ScanOptions& options, ScanRejection* rejection) {
  const auto reject = [rejection](const std::string& reason) {
    if (rejection != nullptr) rejection->reason = reason;
    return nullptr;
  };
  if (!std::isfinite(scan.angle_min) || !std::isfinite(scan.angle_increment) || scan.angle_increment == 0.0) {
    std::ostringstream reason;
    reason << "angle_min " << scan.angle_min << " rad, angle_increment " << scan.angle_increment
           << " rad: both must be finite, the increment not zero";
    return reject(reason.str());
  }
  if (std::abs(base_from_laser.linear()(2, 2)) < std::cos(kMaxTilt)) {
    return reject("the laser's plane is tilted by more than 20 degrees against the x-y plane of base_link");
  }
  auto prepared = std::make_shared<PreparedScan>();
  prepared->stamp = scan.stamp;
  prepared->beams = scan.ranges.size();
  prepared->origin = base_from_laser.translation().head<2>();
  const double range_min = std::max(options.range_min, scan.range_min);
  const double range_max = std::min(options.range_max, scan.range_max);
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    const double range = static_cast<double>(scan.ranges[i]);
    if (!std::isfinite(range) || range < range_min || range > range_max || range <= 0.0) continue;
    const double bearing = scan.angle_min + static_cast<double>(i) * scan.angle_increment;
    const Eigen::Vector3d direction =
        base_from_laser.linear() * Eigen::Vector3d(std::cos(bearing), std::sin(bearing), 0.0);
    prepared->beam.push_back(static_cast<int>(i));
    prepared->ray.push_back(direction.head<2>());
    prepared->range.push_back(range);
    prepared->point.push_back(prepared->origin + range * prepared->ray.back());
  }
  if (prepared->size() < options.min_points) {
    std::ostringstream reason;
    reason << prepared->size() << " of " << scan.ranges.size() << " ranges are finite and within [" << range_min << ", "
           << range_max << "] m, at least " << options.min_points << " are needed";
    return reject(reason.str());
  }
  prepared->range_noise = estimateRangeNoise(*prepared, scan.angle_increment, options);
  fitSurfaces(*prepared, scan.angle_increment, options);
  prepared->map.reserve(prepared->size());
  for (const Eigen::Vector2d& p : prepared->point) {
    prepared->map.insertPointFast(static_cast<float>(p.x()), static_cast<float>(p.y()), 0.0F);
  }
  return prepared;
}

}  // namespace sckf
