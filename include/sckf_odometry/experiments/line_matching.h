// A robot on a circle beside a wall (paper VII-A.2, figure 4).
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "sckf_odometry/core/se2.h"

namespace sckf {

struct LineMatchingOptions {
  double radius = 4.0;           ///< of the circle [m]
  double wall_distance = 6.0;    ///< of the wall from the circle's centre [m]
  double laps = 2.0;             ///< times around
  double spacing = 0.25;         ///< of the scans along the way [m]
  int beams = 90;                ///< of a scan, all around
  double max_range = 20.0;       ///< [m]
  double range_std = 0.05;       ///< [m]
  double odometry_noise = 0.03;  ///< std of x, y after 1 m of way [m/√m], and of yaw [rad/√m]
  int runs = 200;
  std::uint64_t seed = 1;
};

/// Means over the runs at one scan; errors in x (along the wall), y (across), yaw.
struct LineMatchingSample {
  double way = 0.0;  ///< [m]
  Eigen::Vector3d error_of_first_run = Eigen::Vector3d::Zero();
  Eigen::Vector3d std = Eigen::Vector3d::Zero();                ///< by the filter, of the first run
  Eigen::Vector3d squared_error = Eigen::Vector3d::Zero();      ///< mean over the runs
  Eigen::Vector3d variance = Eigen::Vector3d::Zero();           ///< by the filter, mean over the runs
  Eigen::Vector3d normalized_square = Eigen::Vector3d::Zero();  ///< mean of e²/P_ii: 1 is right
  Eigen::Vector3d inside = Eigen::Vector3d::Zero();             ///< share of the runs within the 99.8 % bounds
  double nees = 0.0;                                            ///< mean over the runs: 3 is right
};

/// One method ("sckf", "sckf_nc") on the same robots: the noise depends on the seed and the run alone.
std::vector<LineMatchingSample> simulateLineMatching(const LineMatchingOptions& options, const std::string& method,
                                                     const std::function<void()>& tick);

/// Root mean square over all runs and the second half of the way, of x, y [m] and yaw [rad].
Eigen::Vector3d rootMeanSquare(const std::vector<LineMatchingSample>& samples);

}  // namespace sckf
