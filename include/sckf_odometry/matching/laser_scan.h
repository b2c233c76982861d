// A planar laser scan as a driver delivers it, without any middleware's type.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

namespace sckf {

/// Time since the epoch. Integral, so that equal stamps are equal.
using Stamp = std::chrono::nanoseconds;

inline double seconds(Stamp duration) { return std::chrono::duration<double>(duration).count(); }

/// Up to ±30 years, which added to a time is still a stamp.
inline Stamp toDuration(double seconds) {
  return std::chrono::duration_cast<Stamp>(std::chrono::duration<double>(std::clamp(seconds, -1e9, 1e9)));
}

/// Beam i looks along angle_min + i · angle_increment in the plane of the laser, counter-clockwise about its z axis.
/// A range that is not finite or not within [range_min, range_max) is "no reading" (REP-117; the largest range itself
/// is what many drivers say where they have seen nothing). Beam i was measured at stamp + i · time_increment.
struct LaserScan {
  Stamp stamp{0};
  double angle_min = 0.0;        ///< [rad], within two turns
  double angle_increment = 0.0;  ///< [rad], may be negative, not zero; all beams within a turn
  double time_increment = 0.0;   ///< [s], as the driver tells it: zero, and anything else, where it does not
  double range_min = 0.0;        ///< [m]
  double range_max = 0.0;        ///< [m]
  std::vector<float> ranges;     ///< [m]
};

/// Whether what a beam tells [m] is a reading within [range_min, range_max).
inline bool isReading(double range, double range_min, double range_max) {
  return std::isfinite(range) && range > 0.0 && range >= range_min && range < range_max;
}

}  // namespace sckf
