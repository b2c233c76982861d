// What an exteroceptive sensor says about the motion between two scans.
#pragma once

#include <Eigen/Core>
#include <cstddef>

#include "sckf_odometry/core/se2.h"

namespace sckf {

/// A relative-state measurement z = ξ(z_k, z_{k+m}) with everything that the filter has to know about its error (2):
///   V_oᵀ z̃ = J_reference z̃_k + J_current z̃_{k+m} + n,
/// with independent range noises z̃ and matching noise n. d is the number of directions that the scans see (0 to 3).
struct Displacement {
  using MatrixD3 = Eigen::Matrix<double, Eigen::Dynamic, 3, 0, 3, 3>;
  using Matrix3D = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3>;
  using MatrixDD = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>;

  std::size_t clone = 0;                              ///< which clone is the reference: 0 the newest
  SE2 reference_from_current;                         ///< pose of the current base_link in the reference base_link
  MatrixD3 observable = Eigen::Matrix3d::Identity();  ///< V_oᵀ, d × 3: the combinations of (x, y, yaw) that are seen
  Eigen::MatrixXd J_reference;                        ///< d × M_k, by the ranges of the reference scan [1/m]
  Eigen::MatrixXd J_current;                          ///< d × M_{k+m}, by the ranges of the current scan [1/m]
  Eigen::VectorXd variance_reference;                 ///< M_k, the diagonal of R_k [m²]
  Eigen::VectorXd variance_current;                   ///< M_{k+m}, the diagonal of R_{k+m} [m²]
  MatrixDD matching_noise = Eigen::Matrix3d::Zero();  ///< R_n, d × d: what is not range noise

  Eigen::Index dimension() const { return observable.rows(); }

  /// What is seen as a displacement, 3 × d: V_oᵀ · this = I, and nothing of it is in directions that are not seen.
  Matrix3D fromObservable() const;

  /// R_{k/k+m} = J^k R_k J^kᵀ + J^{k+m} R_{k+m} J^{k+m}ᵀ + R_n, d × d.
  MatrixDD covariance() const;
};

}  // namespace sckf
