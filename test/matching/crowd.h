// A crowd, which is all that a laser sees.
#pragma once

#include <cstddef>
#include <random>

#include "sckf_odometry/matching/laser_scan.h"

namespace sckf {

/// People all around, each six beams wide, in place of what the scan saw.
inline LaserScan amongPeople(LaserScan scan, std::mt19937_64& random) {
  constexpr std::size_t kWidth = 6;
  std::uniform_real_distribution<double> distance(0.3, 2.5);
  std::normal_distribution<double> noise(0.0, 0.02);
  double near = 0.0;
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    if (i % kWidth == 0) near = distance(random);
    scan.ranges[i] = static_cast<float>(near + noise(random));
  }
  return scan;
}

}  // namespace sckf
