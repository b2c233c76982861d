// The straight pieces of surface that a scan sees.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sckf_odometry/core/se2.h"

namespace sckf {

/// [m] How far a wall departs from a straight line as it is built, as a std.
constexpr double kWallRoughness = 0.005;

struct SurfaceOptions {
  double straightness = 1.7;  ///< a surface is straight while its points scatter by this many std of a range
  double length = 1.0;        ///< [m] the stretch over which a surface is fitted grows up to this; one that ends at its
                              ///< point has to be so long
  double max_normal_std = 0.07;  ///< [rad] a surface whose direction is known worse is no surface but single points
};

/// The straight piece of surface around a point, fitted by total least squares to neighbouring points of the scan. How
/// many depends on the range noise: a normal from a few noisy points is noise, and drags a match towards no motion.
struct Surface {
  Eigen::Vector2d centroid = Eigen::Vector2d::Zero();  ///< in base_link [m]
  Eigen::Vector2d normal = Eigen::Vector2d::Zero();    ///< unit vector towards the laser, in base_link
  int first = 0;                                       ///< index of the first point of the fit
  int last = -1;                                       ///< … and of the last; last < first: no straight surface
  double spread = 0.0;  ///< Σ (tᵀd)² − Σ (nᵀd)² over the fit, d = p − centroid, t along the surface [m²]

  bool valid() const { return last >= first; }
  int size() const { return last - first + 1; }
  Eigen::Vector2d tangent() const { return quarterTurn(normal); }
};

/// [m²] Of a point across a surface, by the noise of its range. ray: ∂point/∂range, as the normal of length 1.
inline double varianceAcross(const Eigen::Vector2d& normal, const Eigen::Vector2d& ray, double range_noise) {
  const double noise = range_noise * normal.dot(ray);
  return noise * noise;
}

/// Points in the order of their beams, as a scan has them.
struct ScannedPoints {
  std::vector<int> beam;               ///< index of the beam, increasing
  std::vector<double> range;           ///< [m]
  std::vector<Eigen::Vector2d> point;  ///< in base_link [m]
  std::vector<Eigen::Vector2d> ray;    ///< ∂point/∂range, in base_link

  std::size_t size() const { return point.size(); }
};

/// The surface around each point, invalid where there is none. range_noise: std of a range [m]. angle_increment:
/// between neighbouring beams [rad].
std::vector<Surface> fitSurfaces(const ScannedPoints& points, double range_noise, double angle_increment,
                                 const SurfaceOptions& options);

}  // namespace sckf
