// How long a laser takes for one scan, as its driver tells, and whether that can be.
#pragma once

#include <deque>
#include <string>

#include "sckf_odometry/matching/laser_scan.h"

namespace sckf {

/// What becomes of the robot's motion while a scan is taken.
enum class Deskewing {
  kOff,      ///< nobody asked to undo it
  kDone,     ///< it is undone: each beam is brought to where the robot was at the scan's stamp
  kNotTold,  ///< the driver does not tell when each beam was measured: the scan is used as it is
  kRefused,  ///< what the driver tells cannot be: the scan is used as it is
};
std::string toString(Deskewing deskewing);

/// The time in which the beams of a scan were measured.
struct Sweep {
  Deskewing deskewing = Deskewing::kOff;
  Stamp duration{0};    ///< from the first beam to the last; zero unless kDone
  std::string problem;  ///< what is wrong, in words: value and what is expected; empty if nothing is
};

/// Looks at the scans of one laser in the order in which they come. A driver that fills in time_increment wrongly does
/// so in every scan; a sweep longer than the scans are apart, or than a second, gives it away.
class SweepCheck {
 public:
  /// The scan's stamp must be a time.
  Sweep check(const LaserScan& scan);

 private:
  void note(Stamp stamp);

  std::deque<Stamp> gaps_;  // between the last few scans, none of them zero
  Stamp last_{0};
};

}  // namespace sckf
