#include "core/random_inputs.h"

#include <Eigen/QR>
#include <cmath>

namespace sckf {

int RandomInputs::integer(int low, int high) { return std::uniform_int_distribution<>(low, high)(engine_); }

double RandomInputs::magnitude(double low, double high) { return std::exp(uniform(std::log(low), std::log(high))); }

Eigen::MatrixXd RandomInputs::gaussian(Eigen::Index rows, Eigen::Index cols) {
  return Eigen::MatrixXd::NullaryExpr(rows, cols, [this] { return RandomDraws::gaussian(); });
}

Eigen::MatrixXd RandomInputs::orthogonal(Eigen::Index n) { return gaussian(n, n).householderQr().householderQ(); }

SE2 RandomInputs::pose(double extent) {
  return {uniform(-extent, extent), uniform(-extent, extent), uniform(-M_PI, M_PI)};
}

Eigen::MatrixXd RandomInputs::covariance(Eigen::Index n, double std_dev) {
  const Eigen::MatrixXd A = gaussian(n, n);
  return std_dev * std_dev * (A * A.transpose() / static_cast<double>(n) + 0.1 * Eigen::MatrixXd::Identity(n, n));
}

OdometryIncrement RandomInputs::increment(double std_dev) {
  return {SE2(uniform(-0.1, 0.3), uniform(-0.1, 0.1), uniform(-0.3, 0.3)), covariance(3, std_dev)};
}

Displacement RandomInputs::displacement(const SE2& predicted, int d, const Eigen::VectorXd& variance_reference,
                                        const Eigen::VectorXd& variance_current, double matching_std) {
  const Eigen::MatrixXd directions = orthogonal(3);
  Displacement z;
  z.reference_from_current = corrected(predicted, Eigen::Vector3d(0.05 * gaussian(3)));
  z.observable = directions.topRows(d);
  z.variance_reference = variance_reference;
  z.variance_current = variance_current;
  z.J_reference = gaussian(d, variance_reference.size());
  z.J_current = gaussian(d, variance_current.size());
  z.matching_noise = covariance(d, matching_std);
  return z;
}

Eigen::VectorXd RandomInputs::rangeVariances(int ranges, double low_std, double high_std) {
  return Eigen::VectorXd::NullaryExpr(ranges, [&] { return std::pow(magnitude(low_std, high_std), 2); });
}

}  // namespace sckf
