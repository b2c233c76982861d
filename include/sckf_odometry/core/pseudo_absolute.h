// Displacements as measurements of the absolute pose: Hoffman et al., [10] of the paper. What the SC-KF is compared
// with.
#pragma once

#include "sckf_odometry/core/covariance_intersection.h"
#include "sckf_odometry/core/fusion_method.h"

namespace sckf {

/// A displacement z from the pose X̂_k, put behind it, says where the robot is: X̂_k ⊕ z, with covariance
/// Φ P_k Φᵀ + Γ R Γᵀ. Its error has much in common with that of the pose by the wheels, which started at X̂_k too, but
/// how much is not kept: the two are fused by Covariance Intersection, ω by minimising the trace. Of a displacement
/// that sees d < 3 directions, only these are a measurement.
class PseudoAbsolute : public FusionMethod {
 public:
  PseudoAbsolute(const SE2& odom_from_base, const Eigen::Matrix3d& covariance);

  SE2 pose() const override { return pose_; }
  Eigen::Matrix3d covariance() const override { return covariance_; }

  void propagate(const OdometryIncrement& increment) override;
  DisplacementPrediction predictedDisplacement() const override;
  Innovation innovation(const Displacement& displacement) const override;
  void update(const Displacement& displacement, const Innovation& innovation) override;
  void clone(const Eigen::VectorXd& range_variances) override;

 private:
  CovarianceIntersection intersection(const Displacement& displacement) const;

  SE2 pose_;  // odom_from_base
  Eigen::Matrix3d covariance_;
  SE2 clone_;  // odom_from_base at the reference scan
  Eigen::Matrix3d clone_covariance_;
  Eigen::Matrix3d since_clone_ = Eigen::Matrix3d::Zero();  // covariance of ⊖ clone_ ⊕ pose_: for search and gate alone
};

}  // namespace sckf
