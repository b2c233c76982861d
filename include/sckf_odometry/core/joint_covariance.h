// The covariance of clone, pose and range noise: the one module of the package that changes it.
#pragma once

#include <Eigen/Core>

#include "sckf_odometry/core/displacement.h"

namespace sckf {

/// An innovation r = H_k X̃_k + H X̃ + J^k z̃_k + w (17), projected on the d directions that are seen.
struct Innovation {
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 3, 1>;
  using MatrixD3 = Displacement::MatrixD3;
  using MatrixDD = Displacement::MatrixDD;

  Vector residual;                                         ///< r = V_oᵀ (z ⊖ ẑ), d
  MatrixD3 H_clone;                                        ///< V_oᵀ H_k, d × 3
  MatrixD3 H_pose;                                         ///< V_oᵀ H, d × 3
  MatrixDD noise;                                          ///< covariance of w = J^{k+m} z̃_{k+m} + n, d × d
  MatrixDD covariance;                                     ///< S (19), d × d
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3> gain;  ///< K (21) of the evolving state, 3 × d
  Eigen::MatrixXd with_state;  ///< E{x̃ rᵀ}, N × d, where a method has more states than the pose and its clone

  /// Normalised innovation squared rᵀ S⁻¹ r: χ² with d degrees of freedom where the model is right. Infinite where S is
  /// no covariance.
  double nis() const;
};

/// The covariance of the augmented error state X̆ = [X̃_k; X̃; z̃_k] (5), held by its blocks and never as one matrix:
///
///             clone       pose          range noise
///   clone   [ P_kk        P_kX          P_kz        ]   3 × 3    3 × 3    3 × M
///   pose    [  ·          P_XX          P_Xz = Φ Π  ]            3 × 3    3 × M
///   range   [  ·           ·            R_k         ]                     M × M, diagonal
///
/// Π is P_Xz as it was when it last changed; the product with the transition Φ since then is delayed until it is
/// needed (14). Every operation takes time and memory of order N² + M.
class JointCovariance {
 public:
  /// Clone equal to the pose, no range noise yet (6)(7). The covariance must be symmetric positive semi-definite.
  explicit JointCovariance(const Eigen::Matrix3d& pose_covariance);

  const Eigen::Matrix3d& pose() const { return P_XX_; }
  const Eigen::Matrix3d& clone() const { return P_kk_; }
  const Eigen::Matrix3d& cloneWithPose() const { return P_kX_; }
  Eigen::MatrixXd poseWithRanges() const { return Phi_ * Pi_; }
  const Eigen::MatrixXd& cloneWithRanges() const { return P_kz_; }
  const Eigen::VectorXd& rangeVariances() const { return R_k_; }

  /// The pose moves, clone and ranges stay (9)-(14).
  ///   [ P_kk   P_kX Fᵀ         P_kz   ]
  ///   [  ·     F P_XX Fᵀ + Q   F P_Xz ]
  ///   [  ·      ·              R_k    ]
  /// F: 3 × 3 Jacobian of the motion by the pose. Q: 3 × 3 covariance of the process noise in the frame of the pose.
  void propagate(const Eigen::Matrix3d& F, const Eigen::Matrix3d& Q);

  /// Fills covariance (19) and gain (21) of an innovation whose Jacobians and noise are set. J_reference: d × M.
  void weigh(const Eigen::MatrixXd& J_reference, Innovation& innovation) const;

  /// Schmidt update: the pose is corrected with the innovation's gain; clone and range noise are considered but not
  /// corrected, so that P_kk, P_kz and R_k stay (22)(23). Joseph form.
  ///
  /// Beyond the paper: X̃ ← (I − K̄ H̄) X̆ + U X̃_k, where U X̃_k = [𝒥 δ φ̃_k; 0] and δ is the correction of the position.
  /// It is of second order, but it keeps the clone's own error out of H_k X̃_k + H X̃ at the next displacement to the
  /// same clone: a displacement tells nothing about where its reference is. Without it every correction is taken for a
  /// compass: with references kept for ten scans, a yaw known to 0.3 rad is soon believed to be known to 0.05 rad.
  void update(const Eigen::MatrixXd& J_reference, const Innovation& innovation);

  /// A new clone of the pose (24)-(27). pose_with_ranges (3 × M): P_Xz of the scan that belongs to it, zero if the
  /// scan has not been used for an update. range_variances (M): the diagonal of its R.
  void cloneFromPose(const Eigen::MatrixXd& pose_with_ranges, const Eigen::VectorXd& range_variances);

 private:
  using Projected = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 9, 9>;

  /// Covariance of [X̃_k; X̃; J^k z̃_k], (6 + d) × (6 + d): all that an innovation sees of the range noise is its
  /// projection.
  Projected project(const Eigen::MatrixXd& J_reference) const;

  Eigen::Matrix3d P_kk_;
  Eigen::Matrix3d P_kX_;
  Eigen::Matrix3d P_XX_;
  Eigen::MatrixXd P_kz_;
  Eigen::MatrixXd Pi_;
  Eigen::Matrix3d Phi_ = Eigen::Matrix3d::Identity();
  Eigen::VectorXd R_k_;
};

}  // namespace sckf
