// Reproducible random numbers for the simulations.
#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <cstdint>
#include <random>

namespace sckf {

class RandomDraws {
 public:
  explicit RandomDraws(std::uint64_t seed) : engine_(seed) {}

  double uniform(double low, double high) { return std::uniform_real_distribution<>(low, high)(engine_); }
  double gaussian() { return normal_(engine_); }
  Eigen::VectorXd gaussian(Eigen::Index n) {
    return Eigen::VectorXd::NullaryExpr(n, [this] { return normal_(engine_); });
  }

  /// A draw from N(0, P). P may be singular.
  Eigen::VectorXd drawnFrom(const Eigen::MatrixXd& P) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(P);
    const Eigen::VectorXd std_devs = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt();
    return eigen.eigenvectors() * std_devs.cwiseProduct(gaussian(P.rows()));
  }

 protected:
  std::mt19937_64 engine_;
  std::normal_distribution<> normal_;
};

}  // namespace sckf
