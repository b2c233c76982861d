#include "core/dense_filter.h"

#include <Eigen/LU>
#include <cmath>

namespace sckf {

namespace {

constexpr Eigen::Index kClone = 0;
constexpr Eigen::Index kPose = 3;
constexpr Eigen::Index kRanges = 6;

Eigen::Matrix2d rotationMatrix(double yaw) {
  return (Eigen::Matrix2d() << std::cos(yaw), -std::sin(yaw), std::sin(yaw), std::cos(yaw)).finished();
}

Eigen::Matrix2d quarterTurnMatrix() { return (Eigen::Matrix2d() << 0.0, -1.0, 1.0, 0.0).finished(); }

}  // namespace

DenseFilter::DenseFilter(const SE2& odom_from_base, const Eigen::Matrix3d& covariance)
    : pose_(odom_from_base), clone_(odom_from_base), P_(covariance.replicate(2, 2)) {}  // (6)(7)

void DenseFilter::propagate(const OdometryIncrement& increment) {
  dropCurrent();
  const Eigen::Matrix2d C = rotationMatrix(pose_.yaw);
  const Eigen::Vector2d moved = C * increment.before_from_after.translation();
  pose_ = SE2(pose_.x + moved.x(), pose_.y + moved.y(), pose_.yaw + increment.before_from_after.yaw);

  Eigen::MatrixXd F = Eigen::MatrixXd::Identity(P_.rows(), P_.cols());
  F.block<2, 1>(kPose, kPose + 2) = quarterTurnMatrix() * moved;
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(P_.rows(), 3);
  G.block<2, 2>(kPose, 0) = C;
  G(kPose + 2, 2) = 1.0;
  P_ = F * P_ * F.transpose() + G * increment.covariance * G.transpose();
}

SE2 DenseFilter::predict(Eigen::MatrixXd& H) const {
  const Eigen::Matrix2d C_k_T = rotationMatrix(clone_.yaw).transpose();
  const Eigen::Vector2d apart = pose_.translation() - clone_.translation();
  H.setZero(3, 6);
  H.block<2, 2>(0, kClone) = -C_k_T;
  H.block<2, 1>(0, kClone + 2) = C_k_T * quarterTurnMatrix().transpose() * apart;
  H(2, kClone + 2) = -1.0;
  H.block<2, 2>(0, kPose) = C_k_T;
  H(2, kPose + 2) = 1.0;
  const Eigen::Vector2d seen = C_k_T * apart;
  return {seen.x(), seen.y(), pose_.yaw - clone_.yaw};
}

Eigen::Matrix3d DenseFilter::displacementCovariance() const {
  Eigen::MatrixXd H;
  predict(H);
  return H * P_.topLeftCorner<6, 6>() * H.transpose();
}

DenseFilter::Step DenseFilter::update(const Displacement& z) {
  dropCurrent();
  appendCurrent(z.variance_current);
  Eigen::MatrixXd H_poses;
  const SE2 z_hat = predict(H_poses);
  Eigen::MatrixXd H(z.dimension(), P_.rows());
  H << z.observable * H_poses, z.J_reference, z.J_current;

  Step step;
  step.residual =
      z.observable * Eigen::Vector3d(z.reference_from_current.x - z_hat.x, z.reference_from_current.y - z_hat.y,
                                     wrapAngle(z.reference_from_current.yaw - z_hat.yaw));
  step.S = H * P_ * H.transpose() + z.matching_noise;
  Eigen::MatrixXd K = P_ * H.transpose() * step.S.inverse();
  K.middleRows<3>(kClone).setZero();                  // considered, not corrected:
  K.bottomRows(ranges_ + current_ranges_).setZero();  // the clone and the range noises
  step.gain = K.middleRows<3>(kPose);

  const Eigen::Vector3d correction = step.gain * step.residual;
  pose_ = SE2(pose_.x + correction.x(), pose_.y + correction.y(), pose_.yaw + correction.z());
  const Eigen::MatrixXd A = Eigen::MatrixXd::Identity(P_.rows(), P_.cols()) - K * H;
  P_ = A * P_ * A.transpose() + K * z.matching_noise * K.transpose();
  // p̃ ← p̃ + 𝒥 δ φ̃_k: the lever from the clone is longer by δ than it was when φ̃_k was carried over it.
  Eigen::MatrixXd T = Eigen::MatrixXd::Identity(P_.rows(), P_.cols());
  T.block<2, 1>(kPose, kClone + 2) = quarterTurnMatrix() * correction.head<2>();
  P_ = T * P_ * T.transpose();
  return step;
}

void DenseFilter::clone(const Eigen::VectorXd& range_variances) {
  if (current_ranges_ == 0) appendCurrent(range_variances);  // a scan that has not been used
  // X̆ ← [X̃; X̃; z̃_{k+m}]
  Eigen::MatrixXd select = Eigen::MatrixXd::Zero(6 + current_ranges_, P_.rows());
  select.block<3, 3>(kClone, kPose).setIdentity();
  select.block<3, 3>(kPose, kPose).setIdentity();
  select.block(kRanges, kRanges + ranges_, current_ranges_, current_ranges_).setIdentity();
  P_ = select * P_ * select.transpose();
  clone_ = pose_;
  ranges_ = current_ranges_;
  current_ranges_ = 0;
}

void DenseFilter::dropCurrent() {
  current_ranges_ = 0;
  P_ = P_.topLeftCorner(kRanges + ranges_, kRanges + ranges_).eval();
}

void DenseFilter::appendCurrent(const Eigen::VectorXd& range_variances) {
  const Eigen::Index before = P_.rows();
  current_ranges_ = range_variances.size();
  Eigen::MatrixXd P = Eigen::MatrixXd::Zero(before + current_ranges_, before + current_ranges_);
  P.topLeftCorner(before, before) = P_;
  P.bottomRightCorner(current_ranges_, current_ranges_) = range_variances.asDiagonal();
  P_ = P;
}

}  // namespace sckf
