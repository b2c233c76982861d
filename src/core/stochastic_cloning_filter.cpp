#include "sckf_odometry/core/stochastic_cloning_filter.h"

namespace sckf {

StochasticCloningFilter::StochasticCloningFilter(const SE2& odom_from_base, const Eigen::Matrix3d& covariance,
                                                 Correlations correlations)
    : pose_(odom_from_base),
      clone_(odom_from_base),
      covariance_(covariance),
      pose_with_current_ranges_(3, 0),
      correlations_(correlations) {}

void StochasticCloningFilter::propagate(const OdometryIncrement& increment) {
  Eigen::Matrix3d F;
  Eigen::Matrix3d G;
  pose_ = compose(pose_, increment.before_from_after, &F, &G);         // (8)
  covariance_.propagate(F, G * increment.covariance * G.transpose());  // (9)-(14)
  pose_with_current_ranges_.resize(3, 0);
}

DisplacementPrediction StochasticCloningFilter::predictedDisplacement() const {
  Eigen::Matrix3d H_k;
  Eigen::Matrix3d H;
  const SE2 reference_from_current = between(clone_, pose_, &H_k, &H);  // (16)
  const Eigen::Matrix3d cross = H_k * covariance_.cloneWithPose() * H.transpose();
  return {reference_from_current, H_k * covariance_.clone() * H_k.transpose() + cross + cross.transpose() +
                                      H * covariance_.pose() * H.transpose()};
}

Innovation StochasticCloningFilter::innovation(const Displacement& z) const {
  Eigen::Matrix3d H_k;
  Eigen::Matrix3d H;
  const SE2 z_hat = between(clone_, pose_, &H_k, &H);  // (16)

  Innovation r;
  r.residual = z.observable * error(z.reference_from_current, z_hat);  // (17), projected on V_o
  r.H_clone = z.observable * H_k;                                      // (18)
  r.H_pose = z.observable * H;
  r.noise = correlations_ == Correlations::kKept
                ? Innovation::MatrixDD(z.J_current * z.variance_current.asDiagonal() * z.J_current.transpose() +
                                       z.matching_noise)
                : z.covariance();
  covariance_.weigh(correlatedJacobian(z), r);  // (19)-(21)
  return r;
}

void StochasticCloningFilter::update(const Displacement& z, const Innovation& r) {
  pose_ = corrected(pose_, r.gain * r.residual);  // (22)
  covariance_.update(correlatedJacobian(z), r);   // (23)
  if (correlations_ == Correlations::kKept) {
    pose_with_current_ranges_ = -r.gain * z.J_current * z.variance_current.asDiagonal();  // (26)
  }
}

void StochasticCloningFilter::clone(const Eigen::VectorXd& range_variances) {
  clone_ = pose_;  // (24)
  if (correlations_ == Correlations::kIgnored) {
    covariance_.cloneFromPose(Eigen::MatrixXd(3, 0), Eigen::VectorXd(0));
  } else if (pose_with_current_ranges_.cols() == range_variances.size()) {
    covariance_.cloneFromPose(pose_with_current_ranges_, range_variances);  // (25)-(27)
  } else {  // the scan was not used: its noise is independent of the pose
    covariance_.cloneFromPose(Eigen::MatrixXd::Zero(3, range_variances.size()), range_variances);
  }
}

Eigen::MatrixXd StochasticCloningFilter::correlatedJacobian(const Displacement& z) const {
  return correlations_ == Correlations::kKept ? z.J_reference : Eigen::MatrixXd::Zero(z.dimension(), 0);
}

}  // namespace sckf
