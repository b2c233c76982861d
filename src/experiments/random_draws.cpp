#include "sckf_odometry/experiments/random_draws.h"

#include <Eigen/Eigenvalues>

namespace sckf {

double RandomDraws::uniform(double low, double high) { return std::uniform_real_distribution<>(low, high)(engine_); }

Eigen::VectorXd RandomDraws::gaussian(Eigen::Index n) {
  return Eigen::VectorXd::NullaryExpr(n, [this] { return normal_(engine_); });
}

Eigen::VectorXd RandomDraws::drawnFrom(const Eigen::MatrixXd& P) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(P);
  const Eigen::VectorXd std_devs = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  return eigen.eigenvectors() * std_devs.cwiseProduct(gaussian(P.rows()));
}

}  // namespace sckf
