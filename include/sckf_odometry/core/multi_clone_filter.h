// Stochastic cloning with several clones: the present scan may be compared with any of the references that are kept.
// Section V-B of the paper of stochastic_cloning_filter.h, for displacements.
#pragma once

#include <vector>

#include "sckf_odometry/core/fusion_method.h"

namespace sckf {

/// An extended Kalman filter of the present pose and of every clone, with the range noise of the scans considered. A
/// displacement from the newest clone corrects the present pose, as in Algorithm 1; one from an older clone corrects
/// the clones too. clone() adds a clone, the newest, number 0; forget() removes one.
///
/// Beyond the paper, its error state ξ = (ρ, θ) is a displacement of the world: X = exp(ξ) ⊕ X̂, so that
///   X̃ = T(X̂) ξ,  T = [I 𝒥p̂; 0 1].
/// The motion of the robot leaves ξ as it is, and a displacement between two poses sees nothing but the difference of
/// their ξ, wherever they are estimated to be: nothing that is common to all poses is ever taken for known.
class MultiCloneFilter : public FusionMethod {
 public:
  MultiCloneFilter(const SE2& odom_from_base, const Eigen::Matrix3d& covariance);

  SE2 pose() const override { return inOdom(poses_.front()); }
  Eigen::Matrix3d covariance() const override;
  SE2 clonedPose(std::size_t clone) const { return inOdom(poses_[clone + 1]); }

  void propagate(const OdometryIncrement& increment) override;
  std::size_t clones() const override { return ranges_.size(); }
  DisplacementPrediction predictedDisplacement() const override { return predictedDisplacementFrom(0); }
  DisplacementPrediction predictedDisplacementFrom(std::size_t clone) const override;
  Innovation innovation(const Displacement& displacement) const override;
  void update(const Displacement& displacement, const Innovation& innovation) override;
  void clone(const Eigen::VectorXd& range_variances) override;
  void forget(std::size_t clone) override;

 private:
  /// The noise of one scan's ranges.
  struct RangeNoise {
    Eigen::MatrixXd with_state;  ///< covariance of all ξ and z̃, 3(N + 1) × M
    Eigen::VectorXd variance;    ///< M, the diagonal of R
  };

  SE2 inOdom(const SE2& pose) const;
  bool presentIsUsed() const { return present_.variance.size() > 0; }

  /// Covariance of some rows of the state and of the range noise in an innovation, J^k z̃_k + J^{k+m} z̃_{k+m}: rows × d.
  Eigen::MatrixXd withRangeNoise(const Displacement& displacement, Eigen::Index first, Eigen::Index rows) const;

  /// P_Xz ← P_Xz − K P_rz of one scan, whose noise the innovation contains through J, unless that is null.
  static void correct(RangeNoise& noise, const Eigen::MatrixXd* J, const Eigen::MatrixXd& K,
                      const Eigen::Matrix<double, Eigen::Dynamic, 3>& H, Eigen::Index clone_row);

  Eigen::Vector2d origin_;          // in odom, of the poses below: where the estimate began
  std::vector<SE2> poses_;          // of base_link: the present one, then the clones, the newest first
  Eigen::MatrixXd P_;               // of their ξ, 3(N + 1) × 3(N + 1)
  std::vector<RangeNoise> ranges_;  // of the scans of the clones
  RangeNoise present_;              // of the present scan, empty until it is used
};

}  // namespace sckf
