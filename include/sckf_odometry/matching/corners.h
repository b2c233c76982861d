// Corners: where two straight walls meet, as a scan sees them.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sckf_odometry/core/se2.h"
#include "sckf_odometry/matching/prepared_scan.h"

namespace sckf {

struct CornerOptions {
  double min_length = 0.3;     ///< [m] a corner has so much of straight wall on either side …
  double max_length = 1.5;     ///< [m] … and uses no more of it
  int min_points = 4;          ///< … and at least so many points of either wall
  double min_angle = 0.5;      ///< [rad] walls that are turned less against each other make no corner
  double straightness = 1.7;   ///< a wall is straight while its points scatter by this many std of a range …
  double roughness = 0.02;     ///< [m] … beside this
  double std_position = 0.01;  ///< [m] by how much a corner is not where two straight walls would meet …
  double std_yaw = 0.01;       ///< [rad] … nor turned as they are
};

/// A corner is a frame: its origin is where the lines through both walls meet, its x axis runs midway between the
/// walls.
struct Corner {
  SE2 base_from_corner;
  double angle = 0.0;         ///< between the walls, in (0, π) [rad]
  int first = 0;              ///< the points that it is made of: all from this one …
  int last = -1;              ///< … to this one
  Eigen::Matrix3Xd by_range;  ///< ∂(x, y, yaw)/∂range of each of these points, 3 × (last − first + 1) [1, 1, rad/m]
  Eigen::Matrix3d covariance;  ///< of (x, y, yaw), by the ranges' noise and by std_position, std_yaw
};

/// The corners in the order of the beams; none shares a point with another. Both walls belong to one connected stretch
/// of the scan: where one hides the other there is no corner.
std::vector<Corner> findCorners(const PreparedScan& scan, const CornerOptions& options);

}  // namespace sckf
