#include "sckf_odometry/core/multi_clone_filter.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "sckf_odometry/core/covariance.h"

namespace sckf {

namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Index = Eigen::Index;

/// T: the additive error X̃ = T ξ of a pose.
Matrix3d additive(const SE2& pose) {
  Matrix3d T = Matrix3d::Identity();
  T.topRightCorner<2, 1>() << -pose.y, pose.x;
  return T;
}

Matrix3d inverseOfAdditive(const SE2& pose) { return additive(SE2(-pose.x, -pose.y, 0.0)); }

/// The first row of a clone's ξ.
Index rowOf(std::size_t clone) { return 3 * static_cast<Index>(clone + 1); }

/// K of the whole state, from the covariance of state and innovation.
MatrixXd gain(const MatrixXd& state_with_innovation, const Innovation& innovation) {
  return innovation.covariance.llt().solve(state_with_innovation.transpose()).transpose();
}

/// exp(ξ): the displacement that ξ = (ρ, θ) makes along a circular arc. Without the arc, a correction of the yaw would
/// not turn a pose far from the origin about itself.
SE2 exponential(const Eigen::Vector3d& xi) {
  const double theta = xi.z();
  const double half = 0.5 * theta;
  const double chord = std::abs(half) < 1e-9 ? 1.0 : std::sin(half) / half;
  const Eigen::Vector2d t = chord * (SE2(0.0, 0.0, half).rotation() * xi.head<2>());
  return {t.x(), t.y(), theta};
}

/// A matrix with rows of its own for a clone of the first pose, behind that pose.
MatrixXd withClonedRows(const MatrixXd& A) {
  MatrixXd out(A.rows() + 3, A.cols());
  out.topRows(3) = A.topRows(3);
  out.bottomRows(A.rows()) = A;
  return out;
}

MatrixXd withoutRows(const MatrixXd& A, Index first) {
  MatrixXd out(A.rows() - 3, A.cols());
  out.topRows(first) = A.topRows(first);
  out.bottomRows(out.rows() - first) = A.bottomRows(out.rows() - first);
  return out;
}

}  // namespace

MultiCloneFilter::MultiCloneFilter(const SE2& odom_from_base, const Matrix3d& covariance)
    : origin_(odom_from_base.translation()), poses_{SE2(0.0, 0.0, odom_from_base.yaw)}, P_(covariance) {
  clone(Eigen::VectorXd(0));  // (6)(7)
}

SE2 MultiCloneFilter::inOdom(const SE2& pose) const { return {origin_.x() + pose.x, origin_.y() + pose.y, pose.yaw}; }

Matrix3d MultiCloneFilter::covariance() const {
  const Matrix3d T = additive(poses_.front());
  return symmetric(T * P_.topLeftCorner<3, 3>() * T.transpose());
}

void MultiCloneFilter::propagate(const OdometryIncrement& increment) {
  Matrix3d G;
  poses_.front() = compose(poses_.front(), increment.before_from_after, nullptr, &G);
  const Matrix3d W = inverseOfAdditive(poses_.front()) * G;
  P_.topLeftCorner<3, 3>() += W * increment.covariance * W.transpose();
  present_ = RangeNoise();
}

DisplacementPrediction MultiCloneFilter::predictedDisplacementFrom(std::size_t clone) const {
  Matrix3d J;
  const SE2 reference_from_current = between(poses_[clone + 1], poses_.front(), nullptr, &J);  // (16)
  const Matrix3d H = J * additive(poses_.front());
  const Index k = rowOf(clone);
  const Matrix3d cross = P_.block<3, 3>(0, k);
  const Matrix3d difference = P_.topLeftCorner<3, 3>() + P_.block<3, 3>(k, k) - cross - cross.transpose();
  return {reference_from_current, H * difference * H.transpose()};
}

MatrixXd MultiCloneFilter::withRangeNoise(const Displacement& z, Index first, Index rows) const {
  MatrixXd P_xs = ranges_[z.clone].with_state.middleRows(first, rows) * z.J_reference.transpose();
  if (presentIsUsed()) P_xs += present_.with_state.middleRows(first, rows) * z.J_current.transpose();
  return P_xs;
}

Innovation MultiCloneFilter::innovation(const Displacement& z) const {
  Innovation r;
  Matrix3d H_k;
  Matrix3d H_x;
  const SE2 z_hat = between(poses_[z.clone + 1], poses_.front(), &H_k, &H_x);  // (16)
  r.residual = z.observable * error(z.reference_from_current, z_hat);          // (17), projected on V_o
  r.H_clone = z.observable * H_k;                                              // (18)
  r.H_pose = z.observable * H_x;
  r.noise = z.J_current * z.variance_current.asDiagonal() * z.J_current.transpose() + z.matching_noise;

  const Index k = rowOf(z.clone);
  const MatrixXd H = r.H_pose * additive(poses_.front());
  const MatrixXd pose_with_noise = withRangeNoise(z, 0, 3);
  const MatrixXd clone_with_noise = withRangeNoise(z, k, 3);
  const MatrixXd pose_with_r = (P_.topLeftCorner<3, 3>() - P_.block<3, 3>(0, k)) * H.transpose() + pose_with_noise;
  const MatrixXd clone_with_r = (P_.block<3, 3>(k, 0) - P_.block<3, 3>(k, k)) * H.transpose() + clone_with_noise;
  r.covariance =
      symmetric(H * (pose_with_r - clone_with_r) + (pose_with_noise - clone_with_noise).transpose() * H.transpose() +
                z.J_reference * z.variance_reference.asDiagonal() * z.J_reference.transpose() + r.noise);  // (19)
  r.gain = additive(poses_.front()) * gain(pose_with_r, r);                                                // (21)
  return r;
}

void MultiCloneFilter::correct(RangeNoise& noise, const MatrixXd* J, const MatrixXd& K,
                               const Eigen::Matrix<double, Eigen::Dynamic, 3>& H, Index clone_row) {
  MatrixXd P_rz = H * (noise.with_state.topRows<3>() - noise.with_state.middleRows<3>(clone_row));
  if (J != nullptr) P_rz += *J * noise.variance.asDiagonal();
  noise.with_state.topRows(K.rows()).noalias() -= K * P_rz;
}

void MultiCloneFilter::update(const Displacement& z, const Innovation& r) {
  const Index k = rowOf(z.clone);
  const MatrixXd H = r.H_pose * additive(poses_.front());
  const MatrixXd P_xr = (P_.leftCols<3>() - P_.middleCols<3>(k)) * H.transpose() + withRangeNoise(z, 0, P_.rows());
  // The newest clone's displacement corrects the present pose and considers the rest (21), others correct all poses.
  const Index corrected = z.clone == 0 ? 3 : P_.rows();
  const MatrixXd K = gain(P_xr.topRows(corrected), r);

  if (!presentIsUsed()) present_ = {MatrixXd::Zero(P_.rows(), z.variance_current.size()), z.variance_current};
  for (std::size_t i = 0; i < clones(); ++i) correct(ranges_[i], i == z.clone ? &z.J_reference : nullptr, K, H, k);
  correct(present_, &z.J_current, K, H, k);

  const MatrixXd KP_rx = K * P_xr.transpose();
  P_.topRows(corrected) -= KP_rx;
  P_.leftCols(corrected) -= KP_rx.transpose();
  P_.topLeftCorner(corrected, corrected) += K * r.covariance * K.transpose();
  P_ = symmetric(P_);  // (23)

  const Eigen::VectorXd correction = K * r.residual;  // (22)
  for (Index i = 0; i < corrected / 3; ++i) {
    SE2& pose = poses_[static_cast<std::size_t>(i)];
    pose = compose(exponential(correction.segment<3>(3 * i)), pose);
  }
}

void MultiCloneFilter::clone(const Eigen::VectorXd& range_variances) {
  if (clones() == 1 && ranges_.front().variance.size() == 0) forget(0);          // the start, which was no scan
  if (!presentIsUsed() || present_.variance.size() != range_variances.size()) {  // not used: independent of all poses
    present_ = {MatrixXd::Zero(P_.rows(), range_variances.size()), range_variances};
  }
  poses_.insert(poses_.begin(), SE2(poses_.front()));  // (24)
  P_ = withClonedRows(withClonedRows(P_).transpose());
  ranges_.insert(ranges_.begin(), std::move(present_));  // (26)
  present_ = RangeNoise();
  for (RangeNoise& noise : ranges_) noise.with_state = withClonedRows(noise.with_state);  // (25)
}

void MultiCloneFilter::forget(std::size_t clone) {
  const Index k = rowOf(clone);
  poses_.erase(poses_.begin() + static_cast<std::ptrdiff_t>(clone) + 1);
  ranges_.erase(ranges_.begin() + static_cast<std::ptrdiff_t>(clone));
  P_ = withoutRows(withoutRows(P_, k).transpose(), k);
  for (RangeNoise& noise : ranges_) noise.with_state = withoutRows(noise.with_state, k);
  if (presentIsUsed()) present_.with_state = withoutRows(present_.with_state, k);
}

}  // namespace sckf
