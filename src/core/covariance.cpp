#include "sckf_odometry/core/covariance.h"

#include <Eigen/Eigenvalues>

namespace sckf {

bool isCovariance(const Eigen::Matrix3d& P) {
  constexpr double kTolerance = 1e-9;  // relative
  if (!P.allFinite()) return false;
  const double scale = P.cwiseAbs().maxCoeff();
  if ((P - P.transpose()).cwiseAbs().maxCoeff() > kTolerance * scale) return false;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(P, Eigen::EigenvaluesOnly);
  return eigen.eigenvalues().minCoeff() >= -kTolerance * scale;
}

}  // namespace sckf
