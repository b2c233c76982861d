// Reproducible random numbers for the simulations.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <random>

namespace sckf {

class RandomDraws {
 public:
  explicit RandomDraws(std::uint64_t seed) : engine_(seed) {}

  double uniform(double low, double high);
  double gaussian() { return normal_(engine_); }
  Eigen::VectorXd gaussian(Eigen::Index n);

  /// A draw from N(0, P). P may be singular.
  Eigen::VectorXd drawnFrom(const Eigen::MatrixXd& P);

 protected:
  std::mt19937_64 engine_;
  std::normal_distribution<> normal_;
};

}  // namespace sckf
