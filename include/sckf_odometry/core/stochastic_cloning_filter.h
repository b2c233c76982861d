// The Stochastic Cloning Kalman Filter: Mourikis, Roumeliotis, Burdick, "SC-KF Mobile Robot Localization: A Stochastic
// Cloning Kalman Filter for Processing Relative-State Measurements", IEEE Transactions on Robotics 23(4), 2007.
// Numbers in parentheses are equations of that paper.
#pragma once

#include "sckf_odometry/core/fusion_method.h"

namespace sckf {

/// Algorithm 1 of the paper. A reference may be kept for any number of displacements: the paper's algorithm is the
/// special case in which clone() follows every update().
class StochasticCloningFilter : public FusionMethod {
 public:
  enum class Correlations {
    kKept,     ///< SC-KF: displacements that share a scan are correlated through its range noise
    kIgnored,  ///< SC-KF-NC: P_Xz stays zero, each displacement brings its whole covariance as white noise
  };

  StochasticCloningFilter(const SE2& odom_from_base, const Eigen::Matrix3d& covariance,
                          Correlations correlations = Correlations::kKept);

  SE2 pose() const override { return pose_; }
  Eigen::Matrix3d covariance() const override { return covariance_.pose(); }
  const SE2& clonedPose() const { return clone_; }
  const JointCovariance& jointCovariance() const { return covariance_; }

  void propagate(const OdometryIncrement& increment) override;
  DisplacementPrediction predictedDisplacement() const override;
  Innovation innovation(const Displacement& displacement) const override;
  void update(const Displacement& displacement, const Innovation& innovation) override;
  void clone(const Eigen::VectorXd& range_variances) override;

 private:
  /// J^k as the covariance sees it: without correlations, the reference's ranges are no part of the state.
  Eigen::MatrixXd correlatedJacobian(const Displacement& displacement) const;

  SE2 pose_;   // odom_from_base, X̂
  SE2 clone_;  // odom_from_base at the reference scan, X̂_k
  JointCovariance covariance_;
  Eigen::MatrixXd pose_with_current_ranges_;  // P_{X z_{k+m}} (26), 3 × M; 3 × 0 if the present scan made no update
  Correlations correlations_;
};

}  // namespace sckf
