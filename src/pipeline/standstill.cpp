#include "sckf_odometry/pipeline/standstill.h"

#include <cmath>

namespace sckf {

void Standstill::add(const SE2& motion, double dt, const StandstillOptions& options) {
  const bool rests = motion.translation().norm() <= options.speed * dt && std::abs(motion.yaw) <= options.yaw_rate * dt;
  stood_ = rests ? stood_ + dt : 0.0;
}

}  // namespace sckf
