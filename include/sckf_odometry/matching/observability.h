// Which directions of a displacement two scans see.
#pragma once

#include "sckf_odometry/core/displacement.h"
#include "sckf_odometry/matching/alignment_problem.h"

namespace sckf {

struct ObservabilityOptions {
  double max_std = 0.2;                ///< [m] a direction that the scans tell worse is unobserved
  double min_information_ratio = 8.0;  ///< … as is one whose information is less than this many times the spurious one
};

/// The observable subspace of (x, y, yaw), of dimension d: V_o of the paper (VII-A.2).
struct ObservableDirections {
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3>
      basis;                           ///< 3 × d: change of (x, y, yaw) by a change in the subspace
  Displacement::MatrixD3 coordinates;  ///< d × 3: and back, coordinates · basis = I

  Eigen::Index dimension() const { return basis.cols(); }
};

/// Eigenvectors of the information with yaw scaled by the mean lever, so that all are in metres. Noise of the normals
/// alone makes information where there is none: along a corridor, from normals that err by a degree. A direction must
/// have clearly more information than that.
ObservableDirections observableDirections(const NormalEquations& equations, const ObservabilityOptions& options);

}  // namespace sckf
