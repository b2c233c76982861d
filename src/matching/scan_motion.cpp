#include "sckf_odometry/matching/scan_motion.h"

#include <algorithm>
#include <cassert>

namespace sckf {

void ScanMotion::add(const SE2& before_from_after, double duration) {
  assert(duration > 0.0);
  const SE2 stamp_from_begin = atRest() ? SE2() : compose(parts_.back().stamp_from_begin, parts_.back().begin_from_end);
  const double begin = this->duration();
  parts_.push_back({begin, begin + duration, stamp_from_begin, before_from_after});
}

SE2 ScanMotion::at(double t) const {
  if (atRest()) return {};
  const auto ends_before = [](const Part& part, double time) { return part.end < time; };
  const auto found = std::lower_bound(parts_.begin(), std::prev(parts_.end()), t, ends_before);
  const double share = std::clamp((t - found->begin) / (found->end - found->begin), 0.0, 1.0);
  return compose(found->stamp_from_begin, SE2(share * found->begin_from_end.vector()));
}

}  // namespace sckf
