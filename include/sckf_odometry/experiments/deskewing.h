// A robot that turns to and fro under a laser that takes its time.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "sckf_odometry/experiments/simulated_run.h"

namespace sckf {

struct DeskewingOptions {
  double sweep = 0.09;      ///< [s] from the first beam of a scan to the last
  double range_std = 0.01;  ///< [m]
  int beams = 361;          ///< of a scan, all around
  RunOptions run;
  std::uint64_t seed = 1;
};

struct DeskewingPoint {
  double yaw_rate = 0.0;  ///< [rad/s] the largest of the drive
  RunErrors with;
  RunErrors estimated;  ///< without, the duration of the sweep estimated
  RunErrors without;    ///< scans as they are
};

/// A drive for each yaw rate; the scans are the same each time.
std::vector<DeskewingPoint> simulateDeskewing(const DeskewingOptions& options, const std::vector<double>& yaw_rates,
                                              const std::function<void()>& tick);

}  // namespace sckf
