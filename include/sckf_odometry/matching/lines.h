// Lines: straight walls, as a scan sees them.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sckf_odometry/core/se2.h"
#include "sckf_odometry/matching/prepared_scan.h"

namespace sckf {

struct LineOptions {
  double min_length = 4.0;    ///< [m] a line has so much of straight wall …
  int min_points = 8;         ///< … and so many points of it …
  int points = 6;             ///< … and takes about so many of them, spread over it, never two side by side
  double straightness = 1.7;  ///< a wall is straight while its points scatter by this many std of a range …
  double roughness = 0.02;    ///< [m] … beside this
  double std_offset = 0.03;   ///< [m] by how much a wall is not where the line through its points is …
  double std_yaw = 0.03;      ///< [rad] … nor turned as it is
};

/// A line is a frame: its origin is the middle of the points that it is fitted to, its x axis runs along the wall, its
/// y axis points to the laser's side. Where along the wall the origin is says nothing, and has no error.
struct Line {
  SE2 base_from_line;
  double from = 0.0;           ///< [m] along x, where its points begin …
  double to = 0.0;             ///< [m] … and where they end
  int first = 0;               ///< the points that it is fitted to: from this one …
  int last = -1;               ///< … to this one …
  int every = 2;               ///< … every second, or third, …
  Eigen::Matrix3Xd by_range;   ///< ∂(x, y, yaw)/∂range of each of them, 3 × n [1, 1, rad/m]
  Eigen::Matrix3d covariance;  ///< of (x, y, yaw), of rank 2: by the ranges' noise and by std_offset, std_yaw
};

/// The lines in the order of the beams; none shares a point with another, nor has one that is `taken` (for each point).
std::vector<Line> findLines(const PreparedScan& scan, const std::vector<bool>& taken, const LineOptions& options);

}  // namespace sckf
