// A laser scan made ready for matching: points in base_link, the noise of their ranges, the surface around each.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>
#include <string>
#include <vector>

#include "sckf_odometry/matching/free_space.h"
#include "sckf_odometry/matching/laser_scan.h"
#include "sckf_odometry/matching/point_tree.h"
#include "sckf_odometry/matching/scan_motion.h"
#include "sckf_odometry/matching/surface.h"

namespace mrpt::maps {
class CSimplePointsMap;  // who includes this need not have MRPT
}

namespace sckf {

struct ScanOptions {
  double range_min = 0.0;         ///< [m] readings below are ignored; the scan's own range_min holds too
  double range_max = 80.0;        ///< [m] readings of this or above are ignored; the scan's own range_max holds too
  double range_noise_min = 0.01;  ///< [m] std of a range: no scan is believed to be better than this …
  double range_noise_max = 0.10;  ///< [m] … nor worse than this; in between, the scan itself tells
  double range_offset = 0.0;      ///< [m] added to each reading
  EvenSweep sweep;                ///< undone, if motion is not told beam by beam
  int min_points = 20;            ///< a scan with fewer readings is not usable
  int max_beams = 2048;           ///< of a scan with more, every second beam is used, or every third, …
  SurfaceOptions surface;
};

/// Everything is in base_link at the stamp, projected to its x-y plane. Point i comes from beam points.beam[i].
struct PreparedScan {
  Stamp stamp{0};
  std::size_t beams = 0;                                    ///< M: number of ranges used of the scan, read or not
  double angle_increment = 0.0;                             ///< between neighbouring beams [rad]
  double range_noise = 0.0;                                 ///< std of one range, estimated from this scan [m]
  double range_offset = 0.0;                                ///< that has been added to each range [m]
  EvenSweep sweep;                                          ///< that has been undone
  ScannedPoints points;                                     ///< the readings
  std::vector<Surface> surface;                             ///< the surface around each point
  PointTree tree;                                           ///< the same points, for nearest neighbours
  std::shared_ptr<const mrpt::maps::CSimplePointsMap> map;  ///< and for CICP
  FreeSpace free_space;                                     ///< what the laser looked through
  std::vector<Eigen::Vector2d> set_aside;  ///< what else the laser has seen: points that are not to be matched

  std::size_t size() const { return points.size(); }
  Eigen::VectorXd rangeVariances() const;  ///< M: the diagonal of R [m²]

  /// Derivative of point i by the duration of the sweep [m/s].
  Eigen::Vector2d bySweepDuration(std::size_t i) const;
};

/// base_from_laser may point anywhere: ahead, rotated, upside down. If the scan cannot be used: null, and in rejection,
/// where given, what was found and what is expected, in words for the user. motion: that of base_link while the beams
/// were measured, which is undone, with its own error left aside; at rest, they are taken for measured at once.
std::shared_ptr<const PreparedScan> prepareScan(const LaserScan& scan, const Eigen::Isometry3d& base_from_laser,
                                                const ScanOptions& options, std::string* rejection = nullptr,
                                                const ScanMotion& motion = {});

/// The scan with some of its points set aside: no range of theirs has a part in what is left, not in a surface either.
/// aside: for each point.
std::shared_ptr<const PreparedScan> setAside(const PreparedScan& scan, const std::vector<bool>& aside,
                                             const SurfaceOptions& options);

}  // namespace sckf
