#include "sckf_odometry/core/joint_covariance.h"

#include <Eigen/Cholesky>

#include "sckf_odometry/core/covariance.h"

namespace sckf {

namespace {

/// [H_k H I], d × (6 + d): the innovation's Jacobian by [X̃_k; X̃; J^k z̃_k].
Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 9> projectedJacobian(const Innovation& innovation) {
  const Eigen::Index d = innovation.residual.size();
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 9> H(d, 6 + d);
  H << innovation.H_clone, innovation.H_pose, Innovation::MatrixDD::Identity(d, d);
  return H;
}

/// U: a correction δ of the position lengthens the lever over which the clone's yaw error moves the pose: 𝒥 δ φ̃_k.
Eigen::Matrix3d leverCorrection(const Innovation& innovation) {
  const Eigen::Vector3d correction = innovation.gain * innovation.residual;
  Eigen::Matrix3d U = Eigen::Matrix3d::Zero();
  U.topRightCorner<2, 1>() << -correction.y(), correction.x();
  return U;
}

}  // namespace

double Innovation::nis() const { return normalisedSquare(residual, covariance); }

JointCovariance::JointCovariance(const Eigen::Matrix3d& pose_covariance)
    : P_kk_(pose_covariance),
      P_kX_(pose_covariance),
      P_XX_(pose_covariance),
      P_kz_(Eigen::MatrixXd::Zero(3, 0)),
      Pi_(Eigen::MatrixXd::Zero(3, 0)),
      R_k_(Eigen::VectorXd::Zero(0)) {}

void JointCovariance::propagate(const Eigen::Matrix3d& F, const Eigen::Matrix3d& Q) {
  P_XX_ = symmetric(F * P_XX_ * F.transpose() + Q);
  P_kX_ = P_kX_ * F.transpose();
  Phi_ = F * Phi_;
}

JointCovariance::Projected JointCovariance::project(const Eigen::MatrixXd& J_reference) const {
  const Eigen::Index d = J_reference.rows();
  const Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3> P_ks = P_kz_ * J_reference.transpose();
  const Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3> P_Xs = Phi_ * (Pi_ * J_reference.transpose());  // (14)
  Projected P(6 + d, 6 + d);
  P << P_kk_, P_kX_, P_ks,                 //
      P_kX_.transpose(), P_XX_, P_Xs,      //
      P_ks.transpose(), P_Xs.transpose(),  //
      carriedOver(J_reference, R_k_);
  return P;
}

void JointCovariance::weigh(const Eigen::MatrixXd& J_reference, Innovation& innovation) const {
  const Projected P = project(J_reference);
  const auto H = projectedJacobian(innovation);
  const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 9, 3> P_Ht = P * H.transpose();
  innovation.covariance = symmetric(H * P_Ht + innovation.noise);                                      // (19)
  innovation.gain = innovation.covariance.llt().solve(P_Ht.middleRows<3>(3).transpose()).transpose();  // (21)
}

void JointCovariance::update(const Eigen::MatrixXd& J_reference, const Innovation& innovation) {
  const auto& K = innovation.gain;
  const Projected P = project(J_reference);
  const Eigen::Matrix3d U = leverCorrection(innovation);
  // The pose's rows of I − K̄ H̄ + Ū, where K̄ is K with zero rows for clone and ranges.
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 9> A = -K * projectedJacobian(innovation);
  A.leftCols<3>() += U;
  A.middleCols<3>(3) += Eigen::Matrix3d::Identity();

  // B_z = E{z̃_k rᵀ}, M × d: how the innovation correlates with each range.
  const Eigen::MatrixXd B_z = P_kz_.transpose() * innovation.H_clone.transpose() +
                              Pi_.transpose() * (Phi_.transpose() * innovation.H_pose.transpose()) +
                              R_k_.asDiagonal() * J_reference.transpose();
  P_XX_ = symmetric(A * P * A.transpose() + K * innovation.noise * K.transpose());  // (23)
  P_kX_ = P.topRows<3>() * A.transpose();
  Pi_ = (Phi_ * Pi_ + U * P_kz_ - K * B_z.transpose()).eval();
  Phi_.setIdentity();
}

void JointCovariance::cloneFromPose(const Eigen::MatrixXd& pose_with_ranges, const Eigen::VectorXd& range_variances) {
  P_kk_ = P_XX_;
  P_kX_ = P_XX_;
  P_kz_ = pose_with_ranges;
  Pi_ = pose_with_ranges;
  Phi_.setIdentity();
  R_k_ = range_variances;
}

}  // namespace sckf
