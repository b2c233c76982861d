// What a scan tells of where nothing is.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include "sckf_odometry/matching/laser_scan.h"
#include "sckf_odometry/matching/surface.h"

namespace sckf {

/// The space between the laser and what it sees, beam by beam. Two scans that lie right on each other may each show
/// what the other cannot see, behind a corner or beside its field of view; but neither shows anything where the other
/// has looked through.
class FreeSpace {
 public:
  FreeSpace() = default;  ///< none is known

  /// Of a scan's points, in base_link where they were at its stamp: what the robot's motion meanwhile, or a tilted
  /// laser, makes of beams they have behind them. margin: so much in front of what was seen may still be a part of it
  /// [m].
  FreeSpace(const LaserScan& scan, const Eigen::Isometry3d& base_from_laser, const ScannedPoints& points,
            double margin);

  /// Whether the laser looked through a point, in base_link: the beam towards it and both beside it went farther. Not
  /// where one of them told nothing, and not outside of the field of view.
  bool contains(const Eigen::Vector2d& point) const;

 private:
  std::optional<std::size_t> beamTowards(const Eigen::Vector2d& from_laser) const;

  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();  // of the laser, in base_link [m]
  double first_bearing_ = 0.0;                        // of beam 0, in base_link, in [−π, π] [rad]
  double increment_ = 1.0;                            // [rad], counter-clockwise in base_link
  double beams_in_a_turn_ = 2.0 * M_PI;
  std::vector<double> square_reach_;  // of the free space along each beam [m²]; 0: not known
};

}  // namespace sckf
