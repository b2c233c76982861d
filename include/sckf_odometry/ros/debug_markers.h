// What rviz is shown of one scan that was compared with a reference: messages built from a report, nothing published.
#pragma once

#include <visualization_msgs/MarkerArray.h>

#include <Eigen/Core>
#include <memory>
#include <string>

#include "sckf_odometry/pipeline/scan_odometry.h"

namespace sckf {

/// The ellipse holds this share of the errors of x and y …
constexpr double kEllipseConfidence = 0.95;
/// … and is drawn so many times larger than it is: scans tell a displacement to millimetres.
constexpr double kEllipseMagnification = 10.0;

/// Length of the arrow along a direction that the scans do not see, and its distance from base_link if that is a turn
/// [m].
constexpr double kArrowLength = 1.0;

/// A scan and where it was taken.
struct PlacedScan {
  std::shared_ptr<const PreparedScan> scan;
  SE2 odom_from_base;
};

/// What of (x, y, yaw) the scans do not see: 3 × (3 − d), its columns orthonormal with 1 m beside 1 rad.
Eigen::Matrix3Xd unobservableDirections(const Displacement& displacement);

/// Covariance of the displacement (x, y, yaw), in the reference base_link: in the directions that the scans see it is
/// theirs, in the others that of the prediction.
Eigen::Matrix3d displacementCovariance(const Displacement& displacement, const DisplacementPrediction& prediction);

/// Always the same markers (name space, id), so that each message takes the place of the one before; those that do not
/// apply are to be deleted. Each laser has its own, by the id. In `frame`, at the scan's stamp:
///   pairs         lines from the points of the reference scan to those of the scan at the estimate
///   covariance    ellipse of the displacement, about where the displacement puts base_link
///   unobservable  arrows, one for each direction that the scans do not see: from base_link forwards, or, for a turn,
///                 from ahead of base_link to the left
///   label         what became of the scan, and the numbers
/// The report must be of a scan that was compared with the reference.
visualization_msgs::MarkerArray debugMarkers(const ScanReport& report, const PlacedScan& reference,
                                             const std::string& frame);

/// All of them deleted, of a laser.
visualization_msgs::MarkerArray noDebugMarkers(Stamp stamp, const std::string& frame, std::size_t laser = 0);

}  // namespace sckf
