// Two lasers at their places on a robot, each with half of the room before it, through the whole pipeline.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "sckf_odometry/experiments/simulated_run.h"

namespace sckf {

struct MountedLasersOptions {
  double front_rate = 40.0;  ///< [1/s]
  double rear_rate = 5.0;    ///< [1/s]
  double range_std = 0.03;   ///< [m]
  double yaw_rate = 0.5;     ///< [rad/s] of the head's swing
  int drives = 4;            ///< with each
  RunOptions run;
  std::uint64_t seed = 1;
};

struct MountedLasersRow {
  std::string lasers;  ///< front, rear or both
  RunErrors errors;    ///< of all drives
};

/// tick: after each row.
std::vector<MountedLasersRow> simulateMountedLasers(const MountedLasersOptions& options,
                                                    const std::function<void()>& tick);

}  // namespace sckf
