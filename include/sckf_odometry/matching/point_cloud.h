// A cloud of points in space, as a 3-D lidar or a depth camera sees it, made a planar scan.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "sckf_odometry/matching/laser_scan.h"

namespace sckf {

/// Which points of a cloud are taken for what a planar laser would see.
struct CloudOptions {
  double height_min = 0.1;  ///< [m] z in base_link: lower points are floor …
  double height_max = 1.0;  ///< [m] … and higher ones the robot passes below
  double range_min = 0.1;   ///< [m] points nearer to the sensor, seen from above, are not used …
  double range_max = 50.0;  ///< [m] … nor such as are as far as this, or farther
  int beams = 720;          ///< bins of bearing all around; each has the nearest point in it, or none
};

/// A scan, and where the laser that it is of would be mounted.
struct MountedScan {
  LaserScan scan;
  Eigen::Isometry3d base_from_laser;
};

/// The points within the band of height, projected to the x-y plane of base_link and seen from above the sensor's
/// origin: the laser is there, in that plane, level and turned as base_link, however the sensor is. points: in the
/// sensor's frame [m]; such as are not finite are no points. A beam points to the middle of its bin; it errs by up to
/// half a bin across, which on a wall at an angle is noise of its range.
MountedScan projected(const std::vector<Eigen::Vector3f>& points, Stamp stamp,
                      const Eigen::Isometry3d& base_from_sensor, const CloudOptions& options);

}  // namespace sckf
