// A laser scan made ready for matching: points in base_link, the noise of their ranges, the surface around each.
#pragma once

#include <mrpt/maps/CSimplePointsMap.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sckf_odometry/matching/laser_scan.h"

namespace sckf {

struct ScanOptions {
  double range_min = 0.0;         ///< [m] readings below are ignored; the scan's own range_min holds too
  double range_max = 80.0;        ///< [m] readings above are ignored; the scan's own range_max holds too
  double range_noise_min = 0.01;  ///< [m] std of a range: no scan is believed to be better than this
  double range_noise_max = 0.10;  ///< [m] … nor worse than this
  std::size_t min_points = 20;    ///< a scan with fewer readings is not usable
  double straightness = 2.0;      ///< a surface is straight while its points lie within this many std of a range
  double surface_length = 1.0;    ///< [m] the stretch of surface over which a normal is estimated grows up to this
  double max_normal_std = 0.10;   ///< [rad] a normal that is known worse is not used
};

/// The straight piece of surface around a point, fitted by total least squares to the neighbouring beams.
struct Surface {
  Eigen::Vector2d centroid = Eigen::Vector2d::Zero();  ///< in base_link [m]
  Eigen::Vector2d normal = Eigen::Vector2d::Zero();    ///< unit vector, in base_link
  int first = 0;                                       ///< index of the first point of the fit
  int last = -1;              ///< index of the last one; an empty range means that there is no straight surface here
  double spread = 0.0;        ///< Σ (tᵀ(p − centroid))² − Σ (nᵀ(p − centroid))² over the fit [m²]
  double residual_std = 0.0;  ///< std of the points across the line [m]

  bool valid() const { return last >= first; }
  int size() const { return last - first + 1; }
};

/// Everything is in base_link, projected to its x-y plane; point i comes from beam beam[i], in the order of the beams.
struct PreparedScan {
  Stamp stamp{0};
  std::size_t beams = 0;                             ///< M: number of ranges of the scan, read or not
  double range_noise = 0.0;                          ///< std of one range, estimated from this scan [m]
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();  ///< position of the laser [m]
  std::vector<int> beam;                             ///< index into the ranges
  std::vector<Eigen::Vector2d> point;                ///< [m]
  std::vector<Eigen::Vector2d> ray;                  ///< ∂point/∂range
  std::vector<double> range;                         ///< [m]
  std::vector<Surface> surface;                      ///< the surface around each point
  mrpt::maps::CSimplePointsMap map;                  ///< the same points, for CICP and nearest neighbours

  std::size_t size() const { return point.size(); }
  Eigen::VectorXd rangeVariances() const;  ///< M: the diagonal of R [m²]
};

/// Why a scan cannot be used, in words for the user: what was found and what is expected.
struct ScanRejection {
  std::string reason;
};

/// base_from_laser may point anywhere: ahead, rotated, upside down. Null, and a rejection, if the scan cannot be used.
std::shared_ptr<const PreparedScan> prepareScan(const LaserScan& scan, const Eigen::Isometry3d& base_from_laser,
                                                const ScanOptions& options, ScanRejection* rejection = nullptr);

}  // namespace sckf
