#include "sckf_odometry/core/se3.h"

namespace sckf {

Eigen::Matrix3d crossMatrix(const Eigen::Vector3d& v) {
  return (Eigen::Matrix3d() << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0).finished();
}

Eigen::Matrix3d rotationExp(const Eigen::Vector3d& axis_angle) {
  const double angle = axis_angle.norm();
  if (angle == 0.0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, axis_angle / angle).toRotationMatrix();
}

Eigen::Vector3d rotationLog(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd axis_angle(rotation);
  return axis_angle.angle() * axis_angle.axis();
}

SE3 compose(const SE3& a, const SE3& b, Matrix6d* J_out_a, Matrix6d* J_out_b) {
  const Eigen::Vector3d lever = a.rotation * b.translation;
  if (J_out_a != nullptr) {
    J_out_a->setIdentity();
    J_out_a->topRightCorner<3, 3>() = -crossMatrix(lever);
  }
  if (J_out_b != nullptr) {
    J_out_b->setZero();
    J_out_b->topLeftCorner<3, 3>() = a.rotation;
    J_out_b->bottomRightCorner<3, 3>() = a.rotation;
  }
  return {a.translation + lever, a.rotation * b.rotation};
}

SE3 between(const SE3& a, const SE3& b) {
  return {a.rotation.transpose() * (b.translation - a.translation), a.rotation.transpose() * b.rotation};
}

Vector6d error(const SE3& a, const SE3& b) {
  Vector6d e;
  e << a.translation - b.translation, rotationLog(a.rotation * b.rotation.transpose());
  return e;
}

SE3 corrected(const SE3& a, const Vector6d& e) {
  return {a.translation + e.head<3>(), rotationExp(e.tail<3>()) * a.rotation};
}

}  // namespace sckf
