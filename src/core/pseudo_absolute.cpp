#include "sckf_odometry/core/pseudo_absolute.h"

namespace sckf {

PseudoAbsolute::PseudoAbsolute(const SE2& odom_from_base, const Eigen::Matrix3d& covariance)
    : pose_(odom_from_base), covariance_(covariance), clone_(odom_from_base), clone_covariance_(covariance) {}

void PseudoAbsolute::propagate(const OdometryIncrement& increment) {
  Eigen::Matrix3d F;
  Eigen::Matrix3d G;
  const SE2 reference_from_pose = between(clone_, pose_);
  compose(reference_from_pose, increment.before_from_after, &F, &G);
  since_clone_ = (F * since_clone_ * F.transpose() + G * increment.covariance * G.transpose()).eval();
  pose_ = compose(pose_, increment.before_from_after, &F, &G);
  covariance_ = (F * covariance_ * F.transpose() + G * increment.covariance * G.transpose()).eval();
}

DisplacementPrediction PseudoAbsolute::predictedDisplacement() const { return {between(clone_, pose_), since_clone_}; }

CovarianceIntersection PseudoAbsolute::intersection(const Displacement& z) const {
  Eigen::Matrix3d Phi;
  Eigen::Matrix3d Gamma;
  compose(clone_, z.reference_from_current, &Phi, &Gamma);
  // In the axes of the reference (Γ is a rotation), where it is known which combinations are seen.
  const Innovation::MatrixD3 H = z.observable * Gamma.transpose();
  const Innovation::MatrixD3 H_clone = H * Phi;
  return intersectCovariances(covariance_, H, H_clone * clone_covariance_ * H_clone.transpose() + z.covariance());
}

Innovation PseudoAbsolute::innovation(const Displacement& z) const {
  Eigen::Matrix3d H_k;
  Eigen::Matrix3d H;
  Innovation r;
  r.residual = z.observable * error(z.reference_from_current, between(clone_, pose_, &H_k, &H));
  r.H_clone = z.observable * H_k;
  r.H_pose = z.observable * H;
  r.noise = z.covariance();
  r.covariance = z.observable * since_clone_ * z.observable.transpose() + r.noise;
  r.gain = intersection(z).gain;
  return r;
}

void PseudoAbsolute::update(const Displacement& z, const Innovation& r) {
  const CovarianceIntersection fused = intersection(z);
  Eigen::Matrix3d H;
  between(clone_, pose_, nullptr, &H);
  // ⊖ clone ⊕ pose is corrected by H K r: the bound of its covariance is that of the intersection, with this gain.
  const Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3> K = H * r.gain;
  const Eigen::Matrix3d A = Eigen::Matrix3d::Identity() - K * z.observable;
  since_clone_ =
      (A * since_clone_ * A.transpose() / fused.omega + K * z.covariance() * K.transpose() / (1.0 - fused.omega))
          .eval();
  pose_ = corrected(pose_, r.gain * r.residual);
  covariance_ = fused.covariance;
}

void PseudoAbsolute::clone(const Eigen::VectorXd&) {
  clone_ = pose_;
  clone_covariance_ = covariance_;
  since_clone_.setZero();
}

}  // namespace sckf
