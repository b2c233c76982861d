// A robot that sees nothing, and is told now and then where it is: the estimate in map, which absolute poses correct,
// beside the one in odom, which they leave alone.
#pragma once

#include <cstdint>
#include <vector>

#include "sckf_odometry/experiments/simulated_run.h"

namespace sckf {

struct AbsolutePosesOptions {
  double period = 1.0;     ///< [s] from one absolute pose to the next
  double pose_std = 0.05;  ///< [m, rad]
  SE2 map_from_odom{10.0, -5.0, 1.0};
  RunOptions run;
  std::uint64_t seed = 1;
};

/// At a scan, of which none can be used. What is told of map is NaN before the first absolute pose.
struct AbsolutePosesPoint {
  double time = 0.0;        ///< [s]
  double odom_error = 0.0;  ///< [m] of the position in odom …
  double map_error = 0.0;   ///< [m] … and in map
  double odom_step = 0.0;   ///< [m] by how much the estimate moved otherwise than the robot since the scan before …
  double map_step = 0.0;    ///< [m] … and in map
  double moved = 0.0;       ///< [m] of the estimate in odom, from where it is if there are no absolute poses
};

std::vector<AbsolutePosesPoint> simulateAbsolutePoses(const AbsolutePosesOptions& options);

}  // namespace sckf
