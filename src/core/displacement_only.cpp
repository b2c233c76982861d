#include "sckf_odometry/core/displacement_only.h"

#include <Eigen/Cholesky>

#include "sckf_odometry/core/covariance.h"

namespace sckf {

namespace {

using Replacement = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3>;

/// K with S K = I: the change of D that makes S D what was measured and is smallest otherwise, by what is known of D.
Replacement replacement(const Displacement::MatrixD3& seen, const Eigen::Matrix3d& covariance) {
  constexpr double kVariance = 1e-6;  // (1 mm)², (1 mrad)²: for wheels that stand still, and know it
  const Eigen::Matrix3d W = covariance + kVariance * Eigen::Matrix3d::Identity();
  const Displacement::MatrixDD S = seen * W * seen.transpose();
  return S.llt().solve(seen * W).transpose();
}

}  // namespace

DisplacementOnly::DisplacementOnly(const SE2& odom_from_base, const Eigen::Matrix3d& covariance,
                                   Correlations correlations)
    : clone_(odom_from_base), covariance_(covariance, correlations), correlations_(correlations) {}

Eigen::Matrix3d DisplacementOnly::covariance() const {
  Eigen::Matrix3d Phi;
  Eigen::Matrix3d Gamma;
  compose(clone_, displacement_, &Phi, &Gamma);  // (40)
  return covariance_.covariance(Phi, Gamma);     // (33)
}

void DisplacementOnly::propagate(const OdometryIncrement& increment) {
  Eigen::Matrix3d F;
  Eigen::Matrix3d G;
  displacement_ = compose(displacement_, increment.before_from_after, &F, &G);
  covariance_.propagate(F, G * increment.covariance * G.transpose());
}

DisplacementPrediction DisplacementOnly::predictedDisplacement() const {
  return {displacement_, covariance_.displacement()};
}

DisplacementOnly::Covariance::Measurement DisplacementOnly::measurement(const Displacement& z) const {
  Covariance::Measurement m{z.observable, z.J_reference, z.J_current, z.variance_current, z.matching_noise};
  if (correlations_ == Correlations::kIgnored) {
    m.matching_noise = z.covariance();
    m.J_reference.setZero();
    m.J_current.setZero();
  }
  return m;
}

Innovation DisplacementOnly::innovation(const Displacement& z) const {
  Eigen::Matrix3d H_k;
  Eigen::Matrix3d H;
  between(clone_, pose(), &H_k, &H);
  Innovation r;
  r.residual = z.observable * error(z.reference_from_current, displacement_);
  r.H_clone = z.observable * H_k;
  r.H_pose = z.observable * H;
  r.noise = carriedOver(z.J_current, z.variance_current) + z.matching_noise;
  r.covariance = covariance_.residual(measurement(z));
  r.gain =
      H.transpose() * replacement(z.observable, covariance_.displacement());  // Γ K: H is a rotation, Γ its inverse
  return r;
}

void DisplacementOnly::update(const Displacement& z, const Innovation& r) {
  const Replacement K = replacement(z.observable, covariance_.displacement());
  displacement_ = corrected(displacement_, K * r.residual);
  covariance_.replace(measurement(z), K);
}

void DisplacementOnly::clone(const Eigen::VectorXd& range_variances) {
  Eigen::Matrix3d Phi;
  Eigen::Matrix3d Gamma;
  clone_ = compose(clone_, displacement_, &Phi, &Gamma);
  covariance_.clone(Phi, Gamma, range_variances);
  displacement_ = SE2();
}

}  // namespace sckf
