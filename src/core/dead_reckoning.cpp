#include "sckf_odometry/core/dead_reckoning.h"

#include <Eigen/Cholesky>

#include "sckf_odometry/core/covariance.h"

namespace sckf {

DeadReckoning::DeadReckoning(const SE2& odom_from_base, const Eigen::Matrix3d& covariance)
    : pose_(odom_from_base), covariance_(covariance) {}

void DeadReckoning::propagate(const OdometryIncrement& increment) {
  const auto move = [&increment](SE2& pose, Eigen::Matrix3d& P) {
    Eigen::Matrix3d F;
    Eigen::Matrix3d G;
    pose = compose(pose, increment.before_from_after, &F, &G);
    P = symmetric(F * P * F.transpose() + G * increment.covariance * G.transpose());
  };
  move(pose_, covariance_);
  move(since_clone_.reference_from_current, since_clone_.covariance);
}

Innovation DeadReckoning::innovation(const Displacement& z) const {
  Innovation r;
  r.residual = z.observable * error(z.reference_from_current, since_clone_.reference_from_current);
  r.H_clone = Innovation::MatrixD3::Zero(z.dimension(), 3);
  r.H_pose = r.H_clone;
  r.noise = z.covariance();
  r.covariance = z.observable * since_clone_.covariance * z.observable.transpose() + r.noise;
  r.gain = Eigen::Matrix<double, 3, Eigen::Dynamic>::Zero(3, z.dimension());
  return r;
}

void DeadReckoning::clone(const Eigen::VectorXd&) { since_clone_ = DisplacementPrediction(); }

}  // namespace sckf
