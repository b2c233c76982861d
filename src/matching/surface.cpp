#include "sckf_odometry/matching/surface.h"

#include <algorithm>
#include <cmath>

namespace sckf {

namespace {

/// Running sums over the points, so that the line through any stretch of them costs O(1).
class Moments {
 public:
  explicit Moments(const std::vector<Eigen::Vector2d>& points) : sums_(points.size() + 1, Sums::Zero()) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2d& p = points[i];
      sums_[i + 1] = sums_[i];
      sums_[i + 1] += (Sums() << p.x(), p.y(), p.x() * p.x(), p.x() * p.y(), p.y() * p.y()).finished();
    }
  }

  struct Fit {
    Surface surface;
    double scatter;  ///< std of the points across the line [m]
  };

  /// The total least squares line through the points first … last.
  Fit fit(int first, int last) const {
    const double n = last - first + 1;
    const Sums s = sums_[static_cast<std::size_t>(last) + 1] - sums_[static_cast<std::size_t>(first)];
    const Eigen::Vector2d c = s.head<2>() / n;
    const double xx = s(2) - n * c.x() * c.x();
    const double xy = s(3) - n * c.x() * c.y();
    const double yy = s(4) - n * c.y() * c.y();
    const double half_spread = std::hypot(0.5 * (xx - yy), xy);
    const double direction = 0.5 * std::atan2(xy, 0.5 * (xx - yy));
    const double across = std::max(0.0, 0.5 * (xx + yy) - half_spread);
    const Eigen::Vector2d normal(-std::sin(direction), std::cos(direction));
    return {{c, normal, first, last, 2.0 * half_spread}, std::sqrt(across / std::max(1.0, n - 2.0))};
  }

 private:
  using Sums = Eigen::Matrix<double, 5, 1>;
  std::vector<Sums> sums_;
};

/// Whether the points i and i + 1 can lie on one surface: no farther apart than on a surface seen at a grazing angle
/// (the adaptive breakpoint of Borges and Aldon).
bool connected(const ScannedPoints& points, std::size_t i, double range_noise, double angle_increment) {
  constexpr double kGrazing = 8.0 * M_PI / 180.0;
  constexpr int kMaxBeams = 3;
  const int beams = points.beam[i + 1] - points.beam[i];
  const double step = beams * std::abs(angle_increment);
  if (beams > kMaxBeams || step >= kGrazing) return false;
  const double reach = points.range[i] * std::sin(step) / std::sin(kGrazing - step);
  return (points.point[i + 1] - points.point[i]).norm() <= reach + 3.0 * range_noise;
}

/// The longest stretch around point i, within [begin, end], that is straight within the noise. Noise makes a short
/// stretch look bent now and then: one that is not straight ends the search only if the next longer one is not either.
Surface growSurface(const ScannedPoints& points, const Moments& moments, int i, int begin, int end, double range_noise,
                    const SurfaceOptions& options) {
  Surface longest;
  bool bent = false;
  for (const int half : {2, 3, 4, 6, 8, 11, 15, 20, 27, 36, 48, 64}) {
    const int first = std::max(begin, i - half);
    const int last = std::min(end, i + half);
    if (last - first < 3) continue;
    const Moments::Fit candidate = moments.fit(first, last);
    if (candidate.scatter > options.straightness * range_noise) {
      if (bent) break;
      bent = true;
      continue;
    }
    bent = false;
    longest = candidate.surface;
    const Eigen::Vector2d& a = points.point[static_cast<std::size_t>(first)];
    const Eigen::Vector2d& b = points.point[static_cast<std::size_t>(last)];
    if ((b - a).norm() > options.length || (first == begin && last == end)) break;
  }
  return longest;
}

/// The std of the direction of a fit is σ / √spread.
bool hasDirection(const Surface& surface, double range_noise, const SurfaceOptions& options) {
  return surface.valid() && range_noise < options.max_normal_std * std::sqrt(surface.spread);
}

/// A point that has no surface of its own because noise bent every stretch around it, but lies on one that was fitted
/// to its neighbours with it. Left alone, such points on a wall would claim to know where along the wall they are.
const Surface* surfaceOfNeighbours(const ScannedPoints& points, const std::vector<Surface>& surfaces, int i,
                                   double range_noise) {
  constexpr int kReach = 8;
  constexpr double kOnSurface = 2.5;  // std of a range
  const Eigen::Vector2d& p = points.point[static_cast<std::size_t>(i)];
  for (int distance = 1; distance <= kReach; ++distance) {
    for (const int j : {i - distance, i + distance}) {
      if (j < 0 || j >= static_cast<int>(surfaces.size())) continue;
      const Surface& surface = surfaces[static_cast<std::size_t>(j)];
      const bool covers = surface.valid() && surface.first <= i && i <= surface.last;
      if (covers && std::abs(surface.normal.dot(p - surface.centroid)) < kOnSurface * range_noise) return &surface;
    }
  }
  return nullptr;
}

}  // namespace

std::vector<Surface> fitSurfaces(const ScannedPoints& points, double range_noise, double angle_increment,
                                 const SurfaceOptions& options) {
  const Moments moments(points.point);
  const int n = static_cast<int>(points.size());
  std::vector<Surface> surfaces(points.size());
  for (int begin = 0, end = 0; begin < n; begin = end + 1) {
    end = begin;
    while (end + 1 < n && connected(points, static_cast<std::size_t>(end), range_noise, angle_increment)) ++end;
    for (int i = begin; i <= end; ++i) {
      const auto k = static_cast<std::size_t>(i);
      Surface surface = growSurface(points, moments, i, begin, end, range_noise, options);
      if (!hasDirection(surface, range_noise, options)) continue;
      if (surface.normal.dot(points.ray[k]) > 0.0) surface.normal = -surface.normal;
      surfaces[k] = surface;
    }
  }
  const std::vector<Surface> own = surfaces;
  for (int i = 0; i < n; ++i) {
    Surface& surface = surfaces[static_cast<std::size_t>(i)];
    const Surface* shared = surface.valid() ? nullptr : surfaceOfNeighbours(points, own, i, range_noise);
    if (shared != nullptr) surface = *shared;
  }
  return surfaces;
}

}  // namespace sckf
