// Poses that follow from displacements alone (paper IV): the covariance, for any group of motions.
#pragma once

#include <Eigen/Core>

#include "sckf_odometry/core/covariance.h"

namespace sckf {

/// The covariance of X = X_k ⊕ D, where D, the displacement since the clone X_k, comes from measurements that share
/// their scans with those before and after. For poses whose error has N components: 3 in the plane, 6 in space. The
/// group enters by the Jacobians of ⊕ alone,
///   X̃ = Φ X̃_k + Γ D̃ (40),
/// so that SE(2) and SE(3) share what is written here.
///
/// D̃ is split by what it has in common with the reference scan: D̃ = L z̃_k + w. A displacement that is measured whole
/// has L = −J^k and, in w, the noise of the current scan and the matching noise; with it covariance() is (33). In
/// directions that no displacement has seen, D is by the wheels and their noise is in w.
template <int N>
class DisplacementCovariance {
 public:
  using Square = Eigen::Matrix<double, N, N>;
  using Wide = Eigen::Matrix<double, N, Eigen::Dynamic>;

  enum class Correlations {
    kKept,     ///< (33)
    kIgnored,  ///< (33) without C: each displacement brings its whole covariance as white noise
  };

  /// A measurement of S D: S z = S D + J^k z̃_k + J^{k+m} z̃_{k+m} + n.
  struct Measurement {
    Eigen::MatrixXd seen;              ///< S, d × N
    Eigen::MatrixXd J_reference;       ///< J^k, d × M_k
    Eigen::MatrixXd J_current;         ///< J^{k+m}, d × M_{k+m}
    Eigen::VectorXd variance_current;  ///< diagonal of R_{k+m}, M_{k+m}
    Eigen::MatrixXd matching_noise;    ///< covariance of n, d × d
  };

  DisplacementCovariance(const Square& covariance, Correlations correlations)
      : correlations_(correlations), P_k_(covariance) {}

  /// D moves by the wheels: D̃ ← F D̃ + noise of covariance Q.
  void propagate(const Square& F, const Square& Q) {
    w_ = (F * w_ * F.transpose() + Q).eval();
    L_ = (F * L_).eval();
    current_ = Wide::Zero(N, 0);
  }

  /// What is seen of D is replaced by the measurement: D ← D + K S (z − D), S K = I.
  void replace(const Measurement& z, const Wide& K) {
    const Square A = Square::Identity() - K * z.seen;
    const Wide K_reference = K * z.J_reference;
    const Wide K_current = K * z.J_current;
    L_ = (A * L_ - K_reference).eval();
    w_ = (A * w_ * A.transpose() + K_current * z.variance_current.asDiagonal() * K_current.transpose() +
          K * z.matching_noise * K.transpose())
             .eval();
    current_ = -K_current * z.variance_current.asDiagonal();
  }

  /// The pose of the present scan is the next clone. Φ, Γ: Jacobians of X_k ⊕ D; range_variances: the scan's, M.
  void clone(const Square& Phi, const Square& Gamma, const Eigen::VectorXd& range_variances) {
    P_k_ = covariance(Phi, Gamma);
    const bool used = current_.cols() == range_variances.size();
    P_kz_ = used && correlations_ == Correlations::kKept ? Wide(Gamma * current_)
                                                         : Wide(Wide::Zero(N, range_variances.size()));
    R_k_ = range_variances;
    L_ = Wide::Zero(N, range_variances.size());
    w_.setZero();
    current_ = Wide::Zero(N, 0);
  }

  /// P of X (33): Φ P_k Φᵀ + Γ R Γᵀ + C + Cᵀ with C = Φ P_{X_k z_k} Lᵀ Γᵀ.
  Square covariance(const Square& Phi, const Square& Gamma) const {
    const Square C = Phi * (P_kz_ * L_.transpose()) * Gamma.transpose();
    return symmetric(Phi * P_k_ * Phi.transpose() + Gamma * displacement() * Gamma.transpose() + C + C.transpose());
  }

  /// Of D̃.
  Square displacement() const { return L_ * R_k_.asDiagonal() * L_.transpose() + w_; }

  /// Of S (z − D): range noise of the reference is in both.
  Eigen::MatrixXd residual(const Measurement& z) const {
    const Eigen::MatrixXd by_reference = z.seen * L_ + z.J_reference;
    return by_reference * R_k_.asDiagonal() * by_reference.transpose() + z.seen * w_ * z.seen.transpose() +
           z.J_current * z.variance_current.asDiagonal() * z.J_current.transpose() + z.matching_noise;
  }

 private:
  Correlations correlations_;
  Square P_k_;                    // of the clone
  Square w_ = Square::Zero();     // of the part of D̃ that has nothing to do with the reference scan
  Wide L_ = Wide::Zero(N, 0);     // ∂D̃/∂z̃_k, N × M_k
  Wide P_kz_ = Wide::Zero(N, 0);  // E{X̃_k z̃_kᵀ} = −Γ_{k−1} J^k_{k−1/k} R_k, N × M_k
  Eigen::VectorXd R_k_ = Eigen::VectorXd::Zero(0);
  Wide current_ = Wide::Zero(N, 0);  // E{D̃ z̃_{k+m}ᵀ} of the present scan; N × 0 if it has not been used
};

}  // namespace sckf
