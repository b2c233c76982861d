#include "sckf_odometry/pipeline/twist_window.h"

namespace sckf {

namespace {

/// The way along the curve of an increment, and its rotation: seen from half-way, the chord of an arc points ahead.
Eigen::Vector3d alongTheCurve(const SE2& motion) {
  Eigen::Vector3d way;
  way << SE2(0.0, 0.0, -0.5 * motion.yaw) * motion.translation(), motion.yaw;
  return way;
}

}  // namespace

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
  Twist twist{Eigen::Vector3d::Zero(), Eigen::Matrix3d::Zero()};
  for (const Part& part : parts_) {
    twist.mean += alongTheCurve(part.increment.before_from_after) / covered_;
    twist.covariance += part.increment.covariance / (covered_ * covered_);
  }
  return twist;
}

}  // namespace sckf
