// What a driver writes where its laser has seen nothing, if that looks like a reading.
#pragma once

#include <limits>

#include "sckf_odometry/matching/laser_scan.h"

namespace sckf {

/// Looks at the scans of one laser. A number below range_max that stands for "nothing", as where a log was converted by
/// somebody who did not know the laser, draws an arc around the robot that goes along with it, and holds it. It is the
/// largest number that the laser tells, always the same, and no wall makes such an arc.
class NoReturn {
 public:
  void look(const LaserScan& scan);

  bool isFound() const { return value_ < std::numeric_limits<double>::infinity(); }

  /// [m] Readings of this and more are none; infinite where they are what they seem to be.
  double value() const { return value_; }

 private:
  double value_ = std::numeric_limits<double>::infinity();
};

}  // namespace sckf
