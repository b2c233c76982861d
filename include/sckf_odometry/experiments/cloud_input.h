// A robot that sees clouds of points where another has a planar laser.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "sckf_odometry/experiments/simulated_run.h"

namespace sckf {

/// A lidar of several rings, tilted forward, in the room with a floor.
struct CloudInputOptions {
  int rings = 8;
  double lowest = -0.26;       ///< [rad] elevation of the lowest ring …
  double highest = 0.26;       ///< [rad] … and of the highest
  int bearings = 720;          ///< of each ring, all around
  double wall_height = 2.0;    ///< [m]
  double sensor_height = 0.7;  ///< [m]
  double pitch = 0.1;          ///< [rad]
  double range_std = 0.01;     ///< [m]
  double yaw_rate = 1.0;       ///< [rad/s] the largest of the drive
  RunOptions run;
  std::uint64_t seed = 1;

  CloudInputOptions() { run.duration = 6.0; }
};

struct CloudInputRow {
  std::string input;  ///< "laser", "cloud", "cloud, every height"
  int beams = 0;
  RunErrors errors;
};

/// The drive with a planar laser, and with clouds made scans of different numbers of beams, and without the band of
/// heights.
std::vector<CloudInputRow> simulateCloudInput(const CloudInputOptions& options, const std::vector<int>& beams,
                                              const std::function<void()>& tick);

}  // namespace sckf
