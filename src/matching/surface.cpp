#include "sckf_odometry/matching/surface.h"

#include <algorithm>
#include <cmath>

#include "sckf_odometry/matching/line_fit.h"

namespace sckf {

namespace {

double distanceAcross(const Surface& surface, const Eigen::Vector2d& p) {
  return std::abs(surface.normal.dot(p - surface.centroid));
}

/// Whether both ends of a stretch lie on its line. One that does not, as a point beyond a corner or in the niche of a
/// door, turns the line, and the scatter does not tell of it where a wall is seen at a small angle: it is compared with
/// the noise along the beams, which hardly shows across the wall.
bool endsLieOn(const Surface& surface, const ScannedPoints& points, double range_noise) {
  constexpr double kFarthest = 3.0;  // std
  const auto lies_on = [&](int i) {
    const auto k = static_cast<std::size_t>(i);
    const double variance =
        kWallRoughness * kWallRoughness + varianceAcross(surface.normal, points.ray[k], range_noise);
    const double distance = distanceAcross(surface, points.point[k]);
    return distance * distance <= kFarthest * kFarthest * variance;  // square roots are slow
  };
  return lies_on(surface.first) && lies_on(surface.last);
}

double length(const Surface& surface, const ScannedPoints& points) {
  return (points.point[static_cast<std::size_t>(surface.last)] - points.point[static_cast<std::size_t>(surface.first)])
      .norm();
}

/// The longest stretch around point i that is straight within the noise, between the points begin and end. Noise makes
/// a short stretch look bent now and then: one that is not straight ends the search only if the next longer one is not
/// either.
Surface growSurface(const ScannedPoints& points, const LineFits& fits, int i, int begin, int end, double range_noise,
                    const SurfaceOptions& options) {
  Surface longest;
  bool bent = false;
  for (const int half : {2, 3, 4, 6, 8, 11, 15, 20, 27, 36, 48, 64}) {
    const int first = std::max(begin, i - half);
    const int last = std::min(end, i + half);
    if (last - first < 3) continue;
    const LineFits::Fit candidate = fits.fit(first, last);
    if (candidate.scatter > options.straightness * range_noise || !endsLieOn(candidate.surface, points, range_noise)) {
      if (bent) break;
      bent = true;
      continue;
    }
    bent = false;
    longest = candidate.surface;
    if (length(longest, points) > options.length || (first == begin && last == end)) break;
  }
  return longest;
}

/// Where no stretch around a point is straight it may be where a surface ends: at a corner, or at a door. A stretch to
/// one side of it is a surface if it is as long as any: short ones are often no wall but the niche behind one.
Surface growToOneSide(const ScannedPoints& points, const LineFits& fits, int i, int begin, int end, double range_noise,
                      const SurfaceOptions& options) {
  const Surface before = growSurface(points, fits, i, begin, i, range_noise, options);
  const Surface after = growSurface(points, fits, i, i, end, range_noise, options);
  const Surface& longer = before.spread > after.spread ? before : after;
  return longer.valid() && length(longer, points) > options.length ? longer : Surface();
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
      if (covers && distanceAcross(surface, p) < kOnSurface * range_noise) return &surface;
    }
  }
  return nullptr;
}

}  // namespace

std::vector<Surface> fitSurfaces(const ScannedPoints& points, double range_noise, double angle_increment,
                                 const SurfaceOptions& options) {
  const LineFits fits(points.point);
  const int n = static_cast<int>(points.size());
  std::vector<Surface> surfaces(points.size());
  for (int begin = 0, end = 0; begin < n; begin = end + 1) {
    end = begin;
    while (end + 1 < n && connected(points, static_cast<std::size_t>(end), range_noise, angle_increment)) ++end;
    for (int i = begin; i <= end; ++i) {
      const auto k = static_cast<std::size_t>(i);
      Surface surface = growSurface(points, fits, i, begin, end, range_noise, options);
      if (!surface.valid()) surface = growToOneSide(points, fits, i, begin, end, range_noise, options);
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
