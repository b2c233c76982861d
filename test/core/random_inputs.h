// Reproducible random inputs of the core.
#pragma once

#include <Eigen/Core>
#include <Eigen/QR>
#include <cmath>
#include <cstdint>
#include <random>

#include "sckf_odometry/core/displacement.h"
#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/experiments/random_draws.h"

namespace sckf {

class RandomInputs : public RandomDraws {
 public:
  using RandomDraws::gaussian;
  using RandomDraws::RandomDraws;

  int integer(int low, int high) { return std::uniform_int_distribution<>(low, high)(engine_); }  // both inclusive
  double magnitude(double low, double high) { return std::exp(uniform(std::log(low), std::log(high))); }

  Eigen::MatrixXd gaussian(Eigen::Index rows, Eigen::Index cols) {
    return Eigen::MatrixXd::NullaryExpr(rows, cols, [this] { return RandomDraws::gaussian(); });
  }

  SE2 pose(double extent) { return {uniform(-extent, extent), uniform(-extent, extent), uniform(-M_PI, M_PI)}; }

  /// Positive definite, n × n, standard deviations about std_dev.
  Eigen::MatrixXd covariance(Eigen::Index n, double std_dev) {
    const Eigen::MatrixXd A = gaussian(n, n);
    return std_dev * std_dev * (A * A.transpose() / static_cast<double>(n) + 0.1 * Eigen::MatrixXd::Identity(n, n));
  }

  OdometryIncrement increment(double std_dev) {
    return {SE2(uniform(-0.1, 0.3), uniform(-0.1, 0.1), uniform(-0.3, 0.3)), covariance(3, std_dev)};
  }

  /// A displacement of d random directions near the predicted one, with Jacobians and noises of every size and sign.
  Displacement displacement(const SE2& predicted, int d, const Eigen::VectorXd& variance_reference,
                            const Eigen::VectorXd& variance_current, double matching_std) {
    const Eigen::MatrixXd orthogonal = gaussian(3, 3).householderQr().householderQ();
    Displacement z;
    z.reference_from_current = corrected(predicted, Eigen::Vector3d(0.05 * gaussian(3)));
    z.observable = orthogonal.topRows(d);
    z.variance_reference = variance_reference;
    z.variance_current = variance_current;
    z.J_reference = gaussian(d, variance_reference.size());
    z.J_current = gaussian(d, variance_current.size());
    z.matching_noise = covariance(d, matching_std);
    return z;
  }

  /// The diagonal of R of a scan with that many ranges [m²].
  Eigen::VectorXd rangeVariances(int ranges, double low_std, double high_std) {
    return Eigen::VectorXd::NullaryExpr(ranges, [&] { return std::pow(magnitude(low_std, high_std), 2); });
  }
};

}  // namespace sckf
