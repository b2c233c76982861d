#include "sckf_odometry/pipeline/twist_window.h"

#include "sckf_odometry/core/dead_reckoning.h"

namespace sckf {

void TwistWindow::add(const OdometryIncrement& increment, double dt) {
  parts_.push_back({increment, dt});
  covered_ += dt;
  while (covered_ - parts_.front().dt >= duration_) {
    covered_ -= parts_.front().dt;
    parts_.pop_front();
  }
}

Twist TwistWindow::twist() const {
  if (covered_ < duration_) return {};
  DeadReckoning motion(SE2(), Eigen::Matrix3d::Zero());
  for (const Part& part : parts_) motion.propagate(part.increment);
  return {motion.pose().vector() / covered_, motion.covariance() / (covered_ * covered_)};
}

}  // namespace sckf
