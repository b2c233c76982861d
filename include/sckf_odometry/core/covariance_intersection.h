// Covariance Intersection: S. J. Julier, J. K. Uhlmann, "A non-divergent estimation algorithm in the presence of
// unknown correlations", ACC 1997 ([35] of the paper).
#pragma once

#include <Eigen/Core>

namespace sckf {

/// What to do with an estimate of covariance P and a measurement of H X with covariance R, when nothing is known of how
/// their errors correlate: a Kalman update with both covariances inflated, P/ω and R/(1 − ω), which is the same as
///   P⁺⁻¹ = ω P⁻¹ + (1 − ω) Hᵀ R⁻¹ H
/// but needs no inverse of P. P⁺ is no smaller than the covariance of the error, whatever the correlation.
struct CovarianceIntersection {
  double omega = 1.0;                                      ///< weight of the estimate, in (0, 1)
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3> gain;  ///< 3 × d
  Eigen::Matrix3d covariance;                              ///< P⁺
};

/// The intersection whose covariance has the smallest trace. P (3 × 3): positive semi-definite; H (d × 3), d from 1 to
/// 3, of full rank; R (d × d): positive definite.
CovarianceIntersection intersectCovariances(const Eigen::Matrix3d& P,
                                            const Eigen::Matrix<double, Eigen::Dynamic, 3, 0, 3, 3>& H,
                                            const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>& R);

/// The same with the weight given.
CovarianceIntersection intersectCovariances(const Eigen::Matrix3d& P,
                                            const Eigen::Matrix<double, Eigen::Dynamic, 3, 0, 3, 3>& H,
                                            const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>& R,
                                            double omega);

}  // namespace sckf
