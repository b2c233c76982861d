// Wheel odometry alone.
#pragma once

#include "sckf_odometry/core/fusion_method.h"

namespace sckf {

/// The pose by the wheels, with the covariance of the odometry model; displacements are looked at but change nothing.
class DeadReckoning : public FusionMethod {
 public:
  DeadReckoning(const SE2& odom_from_base, const Eigen::Matrix3d& covariance);

  SE2 pose() const override { return pose_; }
  Eigen::Matrix3d covariance() const override { return covariance_; }

  void propagate(const OdometryIncrement& increment) override;
  void distrustWheels(const Eigen::Matrix3d&) override {}
  DisplacementPrediction predictedDisplacement() const override { return since_clone_; }
  Innovation innovation(const Displacement& displacement) const override;
  void update(const Displacement&, const Innovation&) override {}
  void clone(const Eigen::VectorXd& range_variances) override;

 private:
  SE2 pose_;  // odom_from_base
  Eigen::Matrix3d covariance_;
  DisplacementPrediction since_clone_;
};

}  // namespace sckf
