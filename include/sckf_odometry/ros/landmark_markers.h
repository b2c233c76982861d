// The landmarks of the state, for rviz.
#pragma once

#include <visualization_msgs/MarkerArray.h>

#include <string>
#include <vector>

#include "sckf_odometry/pipeline/scan_report.h"

namespace sckf {

/// Always the same six markers, each of which takes the place of the one before, in `frame`, at the scan's stamp:
///   landmarks   lines, of each corner that the scan has not seen: a cross, its long stroke midway between the walls
///   seen        the same for those that it has
///   covariance  lines, the 95 % ellipse of each one's position
///   lines       lines, of each wall that the scan has not seen, as far as it is known
///   seen_lines  the same for those that it has
///   covariance_of_lines  lines, on either side of each wall, between which it runs with 95 %
visualization_msgs::MarkerArray landmarkMarkers(const std::vector<LandmarkView>& landmarks, Stamp stamp,
                                                const std::string& frame);

}  // namespace sckf
