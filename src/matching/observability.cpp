#include "sckf_odometry/matching/observability.h"

#include <Eigen/Eigenvalues>

namespace sckf {

ObservableDirections observableDirections(const NormalEquations& equations, const ObservabilityOptions& options) {
  const Eigen::Vector3d unit(1.0, 1.0, 1.0 / equations.lever);
  const Eigen::Matrix3d information = unit.asDiagonal() * equations.information * unit.asDiagonal();
  const Eigen::Matrix3d spurious = unit.asDiagonal() * equations.spurious * unit.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(information);

  ObservableDirections directions;
  directions.basis.resize(3, 0);
  directions.coordinates.resize(0, 3);
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d v = eigen.eigenvectors().col(k);
    const double noise = v.dot(spurious * v);
    const bool known = (eigen.eigenvalues()(k) - noise) * options.max_std * options.max_std > 1.0;
    const bool real = eigen.eigenvalues()(k) > options.min_information_ratio * noise;
    if (!known || !real) continue;
    const Eigen::Index d = directions.dimension();
    directions.basis.conservativeResize(3, d + 1);
    directions.basis.col(d) = unit.cwiseProduct(v);
    directions.coordinates.conservativeResize(d + 1, 3);
    directions.coordinates.row(d) = v.cwiseQuotient(unit).transpose();
  }
  return directions;
}

}  // namespace sckf
