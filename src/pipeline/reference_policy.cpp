#include "sckf_odometry/pipeline/reference_policy.h"

#include <cmath>

namespace sckf {

bool ReferencePolicy::replaces(const SE2& reference_from_scan, double overlap, bool used) {
  const SE2 step = between(last_, reference_from_scan);
  const double next_way = reference_from_scan.translation().norm() + step.translation().norm();
  const double next_rotation = std::abs(reference_from_scan.yaw) + std::abs(step.yaw);
  last_ = reference_from_scan;
  failures_ = used ? 0 : failures_ + 1;

  const bool far = next_way > options_.kf_dist_linear || next_rotation > options_.kf_dist_angular;
  const bool hardly_overlaps = used && overlap < options_.kf_min_overlap;
  const bool replaces = far || hardly_overlaps || failures_ >= options_.kf_max_failures;
  if (replaces) {
    last_ = SE2();
    failures_ = 0;
  }
  return replaces;
}

}  // namespace sckf
