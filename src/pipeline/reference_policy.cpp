#include "sckf_odometry/pipeline/reference_policy.h"

#include <algorithm>
#include <cmath>

namespace sckf {

bool ReferencePolicy::replaces(const SE2& reference_from_scan, double overlap, bool used) {
  const SE2 step = between(last_, reference_from_scan);
  const double next_way = reference_from_scan.translation().norm() + step.translation().norm();
  const double next_rotation = std::abs(reference_from_scan.yaw) + std::abs(step.yaw);

  const bool far = next_way > options_.kf_dist_linear || next_rotation > options_.kf_dist_angular;
  most_overlap_ = std::max(most_overlap_, overlap);
  const bool replaces = far || !used || overlap < options_.kf_min_overlap * most_overlap_;
  last_ = replaces ? SE2() : reference_from_scan;
  if (replaces) most_overlap_ = 0.0;
  return replaces;
}

}  // namespace sckf
