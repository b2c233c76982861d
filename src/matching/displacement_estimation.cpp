#include "sckf_odometry/matching/displacement_estimation.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "sckf_odometry/core/covariance.h"
#include "sckf_odometry/matching/line_fit.h"

namespace sckf {

namespace {

using MatrixDD = Displacement::MatrixDD;
using MatrixD3 = Displacement::MatrixD3;

/// Minimises the robust loss in the seen directions, pairs and weights fixed.
SE2 minimise(const AlignmentProblem& problem, SE2 x, const ObservableDirections& seen) {
  constexpr int kMaxIterations = 30;
  constexpr double kStep = 1e-10;
  for (int i = 0; i < kMaxIterations; ++i) {
    const auto equations = problem.normalEquations(x);
    const MatrixDD information = seen.basis.transpose() * equations.information * seen.basis;
    const Eigen::VectorXd step = -information.ldlt().solve(seen.basis.transpose() * equations.gradient);
    x = corrected(x, seen.basis * step);
    if (step.norm() < kStep) break;
  }
  return x;
}

/// Second derivatives of the loss at the solution, by the displacement and by the ranges.
struct LossDerivatives {
  explicit LossDerivatives(const AlignmentProblem& problem)
      : by_reference(Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(problem.reference().beams))),
        by_current(Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(problem.current().beams))) {}

  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();  // ∂²L/∂x²
  Eigen::Matrix3Xd by_reference;                      // ∂²L/∂x∂z_k, 3 × M_k
  Eigen::Matrix3Xd by_current;                        // ∂²L/∂x∂z_{k+m}, 3 × M_{k+m}
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();  // Σ over blocks of beams of g gᵀ, g the gradient of a block
  int blocks = 0;
  double loss_weight = 0.0;
  double loss_square = 0.0;
};

/// A surface's line turns and shifts with every range that it was fitted to.
void addSurfaceDerivatives(const AlignmentProblem& problem, const Residual& residual, const ResidualTerms& t,
                           LossDerivatives& out) {
  const Surface& surface = *residual.surface;
  const ScannedPoints& points = problem.reference().points;
  const double along = surface.tangent().dot(t.offset);
  const Eigen::Vector3d by_angle = problem.kernel().influence(t.e) * AlignmentProblem::derivativeByNormal(residual, t);
  const Eigen::Vector3d by_residual = problem.kernel().slope(t.e) / residual.std * t.A;
  for (int j = surface.first; j <= surface.last; ++j) {
    const double turn = turnByRange(surface, points, j);
    const double shift = -shiftByRange(surface, points, j) + along * turn;
    out.by_reference.col(points.beam[static_cast<std::size_t>(j)]) += by_angle * turn + by_residual * shift;
  }
}

void addDerivatives(const AlignmentProblem& problem, const Residual& residual, const RigidMotion& x,
                    const ResidualTerms& t, LossDerivatives& out) {
  const double influence = problem.kernel().influence(t.e);
  const double slope = problem.kernel().slope(t.e);
  out.hessian += slope * t.A * t.A.transpose();
  out.hessian(2, 2) -= influence / residual.std * residual.normal.dot(t.lever);

  const ScannedPoints& current = problem.current().points;
  const auto c = static_cast<std::size_t>(residual.current);
  const Eigen::Vector2d ray = x.C * current.ray[c];
  Eigen::Vector3d by_range = slope / residual.std * residual.normal.dot(ray) * t.A;
  by_range.z() += influence / residual.std * residual.normal.dot(quarterTurn(ray));
  out.by_current.col(current.beam[c]) += by_range;

  if (residual.surface != nullptr) {
    addSurfaceDerivatives(problem, residual, t, out);
  } else {
    const ScannedPoints& reference = problem.reference().points;
    const auto r = static_cast<std::size_t>(residual.reference);
    out.by_reference.col(reference.beam[r]) -= slope / residual.std * residual.normal.dot(reference.ray[r]) * t.A;
  }
}

LossDerivatives differentiate(const AlignmentProblem& problem, const RigidMotion& x, const EstimationOptions& options) {
  LossDerivatives out(problem);
  Eigen::Vector3d block_gradient = Eigen::Vector3d::Zero();
  int block = -1;
  for (const Residual& residual : problem.residuals()) {
    const ResidualTerms t = problem.terms(residual, x);
    addDerivatives(problem, residual, x, t, out);
    const double w = problem.kernel().weight(t.e);
    out.loss_weight += w;
    out.loss_square += w * t.e * t.e;
    const int its_block =
        problem.current().points.beam[static_cast<std::size_t>(residual.current)] / options.correlated_beams;
    if (its_block != block) {
      out.scatter += block_gradient * block_gradient.transpose();
      block_gradient.setZero();
      block = its_block;
      ++out.blocks;
    }
    block_gradient += w * t.e * t.A;
  }
  out.scatter += block_gradient * block_gradient.transpose();
  return out;
}

/// R_n: by how much the residuals scatter beyond what range noise explains, as a covariance of the displacement. Range
/// noise gives R_z; the gradients of blocks of neighbouring beams give what is seen, as a variance is seen in so many
/// samples: to √(2/blocks). Only what exceeds both is matching noise.
MatrixDD matchingNoise(const MatrixDD& range_covariance, const MatrixDD& seen_covariance, int blocks) {
  const Eigen::LLT<MatrixDD> range(range_covariance);
  const MatrixDD L = range.matrixL();
  MatrixDD whitened = range.matrixL().solve(seen_covariance);
  whitened = range.matrixL().solve(whitened.transpose()).eval();
  const Eigen::SelfAdjointEigenSolver<MatrixDD> eigen(symmetric(whitened));
  const Eigen::VectorXd excess = (eigen.eigenvalues().array() - 1.0 - std::sqrt(2.0 / blocks)).max(0.0);
  const MatrixDD half = L * eigen.eigenvectors();
  return half * excess.asDiagonal() * half.transpose();
}

}  // namespace

std::optional<DisplacementEstimate> estimateDisplacement(const AlignmentProblem& problem, const SE2& start,
                                                         const EstimationOptions& options) {
  const ObservableDirections seen = observableDirections(problem.normalEquations(start), options.observability);
  if (seen.dimension() == 0) return std::nullopt;
  const SE2 x = minimise(problem, start, seen);
  const LossDerivatives loss = differentiate(problem, RigidMotion(x), options);
  const MatrixDD hessian = seen.basis.transpose() * loss.hessian * seen.basis;
  const MatrixD3 implicit = hessian.inverse() * seen.basis.transpose();

  DisplacementEstimate estimate;
  Displacement& z = estimate.displacement;
  z.reference_from_current = x;
  z.observable = seen.coordinates;
  z.J_reference = -implicit * loss.by_reference;
  z.J_current = -implicit * loss.by_current;
  z.variance_reference = problem.reference().rangeVariances();
  z.variance_current = problem.current().rangeVariances();
  z.matching_noise = MatrixDD::Zero(seen.dimension(), seen.dimension());
  z.matching_noise = matchingNoise(z.covariance(), implicit * loss.scatter * implicit.transpose(), loss.blocks);
  estimate.residual_rms = std::sqrt(loss.loss_square / loss.loss_weight);
  return estimate;
}

Displacement meanOfBothWays(const Displacement& there, const Displacement& back) {
  Eigen::Matrix3d by_back;
  const SE2 inverted = inverse(back.reference_from_current, &by_back);
  const Eigen::Matrix3d to_coordinates = there.observable;
  const Eigen::Matrix3d A = to_coordinates * by_back * Eigen::Matrix3d(back.observable).inverse();
  const Eigen::Vector3d half_difference = 0.5 * error(inverted, there.reference_from_current);
  const Eigen::Vector3d d = to_coordinates * half_difference;
  Displacement mean = there;
  mean.reference_from_current = corrected(there.reference_from_current, half_difference);
  mean.J_reference = 0.5 * (there.J_reference + A * back.J_current);
  mean.J_current = 0.5 * (there.J_current + A * back.J_reference);
  mean.matching_noise =
      symmetric(0.5 * (there.matching_noise + A * back.matching_noise * A.transpose()) + d * d.transpose());
  return mean;
}

}  // namespace sckf
