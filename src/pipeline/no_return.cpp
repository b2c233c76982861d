#include "sckf_odometry/pipeline/no_return.h"

#include <algorithm>
#include <cmath>

namespace sckf {

namespace {

/// So many beams side by side tell the same number by chance nowhere but on a wall …
constexpr int kFewest = 5;

/// … of which so deep an arc is none [m]: drivers round to 0.05 m at most.
constexpr double kDeepest = 0.05;

}  // namespace

void NoReturn::look(const LaserScan& scan) {
  double largest = 0.0;
  int beams = 0;  // side by side that tell it, up to this one …
  int most = 0;   // … and wherever they are most
  for (const float told : scan.ranges) {
    const auto range = static_cast<double>(told);
    const bool read = isReading(range, scan.range_min, scan.range_max);
    if (read && range > largest) {
      largest = range;
      beams = most = 0;
    }
    beams = read && range == largest ? beams + 1 : 0;
    most = std::max(most, beams);
  }
  if (largest > value_) value_ = std::numeric_limits<double>::infinity();
  const double half = std::min(0.5 * (most - 1) * std::abs(scan.angle_increment), M_PI_2);
  const double depth = largest * (1.0 - std::cos(half));
  if (most >= kFewest && depth > kDeepest) value_ = largest;
}

}  // namespace sckf
