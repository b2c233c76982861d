// The filter a second time, with dense matrices: what the fast one is compared with.
#pragma once

#include <Eigen/Core>

#include "sckf_odometry/core/fusion_method.h"

namespace sckf {

/// Carries the covariance of the whole augmented error state as one matrix, with the current scan's noise in it from
/// the moment the scan is used. Cubic in the number of ranges, and nothing in it is delayed, skipped or folded.
///
///   X̆ = [ X̃_k (clone);  X̃ (pose);  z̃_k (M_k);  z̃_{k+m} (M_{k+m}, or none) ]
class DenseFilter {
 public:
  struct Step {
    Eigen::VectorXd residual;  // r, d
    Eigen::MatrixXd S;         // d × d
    Eigen::MatrixXd gain;      // rows of the pose, 3 × d
  };

  DenseFilter(const SE2& odom_from_base, const Eigen::Matrix3d& covariance);

  void propagate(const OdometryIncrement& increment);
  Step update(const Displacement& displacement);
  void clone(const Eigen::VectorXd& range_variances);

  const SE2& pose() const { return pose_; }
  const SE2& clonedPose() const { return clone_; }
  const Eigen::MatrixXd& covariance() const { return P_; }
  Eigen::Index ranges() const { return ranges_; }  ///< M_k

  /// H̆ P H̆ᵀ of the displacement from clone to pose, without range noise: 3 × 3.
  Eigen::Matrix3d displacementCovariance() const;

 private:
  /// ẑ (16) and [H_k H] (18), 3 × 6.
  SE2 predict(Eigen::MatrixXd& H) const;
  /// The scan at hand is gone: its noise leaves the state.
  void dropCurrent();
  void appendCurrent(const Eigen::VectorXd& range_variances);

  SE2 pose_;   // odom_from_base
  SE2 clone_;  // odom_from_base at the reference scan
  Eigen::MatrixXd P_;
  Eigen::Index ranges_ = 0;
  Eigen::Index current_ranges_ = 0;
};

}  // namespace sckf
