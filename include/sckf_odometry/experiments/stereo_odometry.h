// Displacements in space from features that a stereo pair of cameras sees twice.
#pragma once

#include <vector>

#include "sckf_odometry/core/displacement_covariance.h"
#include "sckf_odometry/core/se3.h"

namespace sckf {

/// A rectified pair of pinhole cameras looking along z, x to the right, y down.
struct StereoCamera {
  double focal_length = 400.0;  ///< [pixel]
  double half_width = 320.0;    ///< of the image [pixel]
  double half_height = 240.0;   ///< [pixel]
  double baseline = 0.3;        ///< [m]
  double near = 1.0;            ///< depth of the nearest features that are used [m]
  double far = 10.0;            ///< … and of the farthest [m]

  /// Column and row in the left image, column in the right.
  Eigen::Vector3d project(const Eigen::Vector3d& point) const;
  bool sees(const Eigen::Vector3d& point) const;
  /// The point of a projection, and its derivative, 3 × 3.
  Eigen::Vector3d triangulate(const Eigen::Vector3d& pixels, Eigen::Matrix3d* J_point_pixels) const;
};

/// What one view measured: three pixel coordinates per feature, 3n in all, which play the part of a scan's ranges.
struct StereoView {
  std::vector<int> features;            ///< their numbers, increasing
  std::vector<Eigen::Vector3d> pixels;  ///< per feature
};

/// The displacement that aligns the points of the features that both views have, weighted by their covariances, with
/// its Jacobians by every pixel coordinate of either view (zero for features that only one has).
struct StereoDisplacement {
  SE3 reference_from_current;
  DisplacementCovariance<6>::Measurement measurement;
  int shared = 0;  ///< features that both have; with fewer than three there is no displacement
};
StereoDisplacement matchViews(const StereoCamera& camera, const StereoView& reference, const StereoView& current,
                              double pixel_std, const SE3& guess);

}  // namespace sckf
