#include "sckf_odometry/core/se2.h"

#include <cmath>

namespace sckf {

double wrapAngle(double angle) {
  const double wrapped = std::remainder(angle, 2.0 * M_PI);
  return wrapped <= -M_PI ? M_PI : wrapped;
}

Eigen::Matrix2d SE2::rotation() const {
  const double c = std::cos(yaw);
  const double s = std::sin(yaw);
  return (Eigen::Matrix2d() << c, -s, s, c).finished();
}

SE2 compose(const SE2& a, const SE2& b, Eigen::Matrix3d* J_out_a, Eigen::Matrix3d* J_out_b) {
  const Eigen::Matrix2d C = a.rotation();
  const Eigen::Vector2d lever = C * b.translation();
  if (J_out_a != nullptr) {
    J_out_a->setIdentity();
    J_out_a->topRightCorner<2, 1>() = quarterTurn(lever);
  }
  if (J_out_b != nullptr) {
    J_out_b->setIdentity();
    J_out_b->topLeftCorner<2, 2>() = C;
  }
  return {a.x + lever.x(), a.y + lever.y(), a.yaw + b.yaw};
}

SE2 inverse(const SE2& a, Eigen::Matrix3d* J_out_a) {
  const Eigen::Matrix2d C_T = a.rotation().transpose();
  const Eigen::Vector2d p = -(C_T * a.translation());
  if (J_out_a != nullptr) {
    *J_out_a << -C_T, -quarterTurn(p), 0.0, 0.0, -1.0;
  }
  return {p.x(), p.y(), -a.yaw};
}

SE2 between(const SE2& a, const SE2& b, Eigen::Matrix3d* J_out_a, Eigen::Matrix3d* J_out_b) {
  const Eigen::Matrix2d C_T = a.rotation().transpose();
  const Eigen::Vector2d p = C_T * (b.translation() - a.translation());
  if (J_out_a != nullptr) {
    *J_out_a << -C_T, -quarterTurn(p), 0.0, 0.0, -1.0;
  }
  if (J_out_b != nullptr) {
    J_out_b->setIdentity();
    J_out_b->topLeftCorner<2, 2>() = C_T;
  }
  return {p.x(), p.y(), b.yaw - a.yaw};
}

Eigen::Vector3d error(const SE2& a, const SE2& b) { return {a.x - b.x, a.y - b.y, wrapAngle(a.yaw - b.yaw)}; }

SE2 corrected(const SE2& a, const Eigen::Vector3d& e) { return {a.x + e.x(), a.y + e.y(), a.yaw + e.z()}; }

}  // namespace sckf
