#include "sckf_odometry/matching/displacement_estimation.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "sckf_odometry/core/covariance.h"
#include "sckf_odometry/matching/line_fit.h"

namespace sckf {

namespace {

using MatrixDD = Displacement::MatrixDD;
using MatrixD3 = Displacement::MatrixD3;

/// ∂²L/∂x² of one residual. Inline, as addDerivatives, because they are called for each.
inline Eigen::Matrix3d hessianOf(const RobustKernel& kernel, const Residual& residual, const ResidualTerms& t) {
  Eigen::Matrix3d hessian = kernel.slope(t.e) * t.A * t.A.transpose();
  hessian(2, 2) -= kernel.influence(t.e) * residual.precision * residual.normal.dot(t.lever);
  return hessian;
}

/// Derivatives of the loss by the displacement, at one of a search.
struct LossSlope {
  WeightedSquares squares;  // its information: the hessian of the loss with its weights fixed
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();

  LossSlope(const AlignmentProblem& problem, const SE2& x) {
    const RigidMotion motion(x);
    for (const Residual& residual : problem.residuals()) {
      const ResidualTerms t = problem.terms(residual, motion);
      squares.add(problem.kernel().weight(t.e), t);
      hessian += hessianOf(problem.kernel(), residual, t);
    }
  }
};

/// Minimises the robust loss in the seen directions, pairs and weights fixed: by Newton's steps where the loss is
/// convex, by those of reweighted least squares, which are many but never lead uphill, elsewhere.
SE2 minimise(const AlignmentProblem& problem, SE2 x, const ObservableDirections& seen) {
  constexpr int kMaxIterations = 30;
  constexpr double kStep = 1e-9;
  constexpr double kNewtonStep = 1e-6;  // after which the error is about its square
  constexpr double kConvex = 0.3;       // of the curvature with weights fixed
  const auto& B = seen.basis;
  for (int i = 0; i < kMaxIterations; ++i) {
    const LossSlope slope(problem, x);
    const MatrixDD hessian = B.transpose() * slope.hessian * B;
    const MatrixDD information = B.transpose() * slope.squares.information() * B;
    const bool convex = Eigen::LLT<MatrixDD>(hessian - kConvex * information).info() == Eigen::Success;
    const Eigen::VectorXd step =
        -(convex ? hessian : information).ldlt().solve(B.transpose() * slope.squares.gradient());
    x = corrected(x, B * step);
    if (step.norm() < (convex ? kNewtonStep : kStep)) break;
  }
  return x;
}

/// The part of the loss that neighbouring beams of the current scan have, which may err together.
struct BeamBlock {
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
};

/// What the normal equations have more by a constant c of the laser, with b = ∂e/∂c.
struct ByConstant {
  Eigen::Vector3d coupling = Eigen::Vector3d::Zero();  // Σ w A b
  double information = 0.0;                            // Σ w b²
  double gradient = 0.0;                               // Σ w e b

  /// shift: how much more the current point is before the line when c is more.
  void add(double weight, const Residual& residual, const ResidualTerms& t, double shift) {
    const double b = shift * residual.precision;
    coupling += weight * b * t.A;
    information += weight * b * b;
    gradient += weight * b * t.e;
  }
};

/// Derivatives of the loss at the solution, by the displacement and by the ranges.
struct LossDerivatives {
  explicit LossDerivatives(const AlignmentProblem& problem)
      : by_reference(Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(problem.reference().beams))),
        by_current(Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(problem.current().beams))) {}

  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();  // ∂²L/∂x²
  Eigen::Matrix3Xd by_reference;                      // ∂²L/∂x∂z_k, 3 × M_k
  Eigen::Matrix3Xd by_current;                        // ∂²L/∂x∂z_{k+m}, 3 × M_{k+m}
  std::vector<BeamBlock> blocks;                      // of which the hessian is the sum
  std::vector<PointPull> pulls;                       // ∂²L/∂x∂p with weights fixed
  WeightedSquares squares;
  double weight = 0.0;  // Σ w
  ByConstant by_range_offset;
  ByConstant by_sweep_duration;

  double meanSquare() const { return squares.residuals() / weight; }  // of the residuals, in units of their noise
  double excess() const { return std::max(1.0, meanSquare()); }

  /// Of the constant, the displacement eliminated. Nothing where a direction is not seen: the constant would make up
  /// for what the prediction is wrong by there.
  ConstantEvidence evidence(const ByConstant& constant, const ObservableDirections& seen) const {
    if (seen.dimension() < 3) return {};
    const Eigen::Vector3d eliminated = squares.information().ldlt().solve(constant.coupling);
    const double left = constant.information - constant.coupling.dot(eliminated);
    const double value = -(constant.gradient - eliminated.dot(squares.gradient())) / left;
    if (!(left > 0.0) || !std::isfinite(value)) return {};
    return {value, left, 0.0};
  }
};

/// A surface's line turns and shifts with every range that it was fitted to. Returns by how much more the current point
/// is before it when all of them are longer.
double addSurfaceDerivatives(const AlignmentProblem& problem, const Residual& residual, const ResidualTerms& t,
                             LossDerivatives& out) {
  const Surface& surface = *residual.surface;
  const ScannedPoints& points = problem.reference().points;
  const double along = surface.tangent().dot(t.offset);
  const Eigen::Vector3d by_angle = problem.kernel().influence(t.e) * AlignmentProblem::derivativeByNormal(residual, t);
  const Eigen::Vector3d by_residual = problem.kernel().slope(t.e) * residual.precision * t.A;
  const LineByRange by_range(surface, points);
  double together = 0.0;
  for (int j = surface.first; j <= surface.last; ++j) {
    const double turn = by_range.turn(j);
    const double shift = -by_range.shift(j) + along * turn;
    out.by_reference.col(points.beam[static_cast<std::size_t>(j)]) += by_angle * turn + by_residual * shift;
    together += shift;
  }
  return together;
}

/// Points on no surface have two residuals, one after the other.
inline void addPull(double weight, const Residual& residual, const ResidualTerms& t, std::vector<PointPull>& pulls) {
  if (pulls.empty() || pulls.back().point != residual.current) pulls.push_back({residual.current});
  pulls.back().by_position += weight * t.A * (residual.precision * residual.normal).transpose();
}

inline void addDerivatives(const AlignmentProblem& problem, const Residual& residual, const RigidMotion& x,
                           LossDerivatives& out) {
  const ResidualTerms t = problem.terms(residual, x);
  const double influence = problem.kernel().influence(t.e);
  const double slope = problem.kernel().slope(t.e);
  const Eigen::Matrix3d hessian = hessianOf(problem.kernel(), residual, t);
  out.hessian += hessian;
  out.blocks.back().hessian += hessian;
  out.blocks.back().gradient += influence * t.A;

  const ScannedPoints& current = problem.current().points;
  const auto c = static_cast<std::size_t>(residual.current);
  const Eigen::Vector2d ray = x.C * current.ray[c];
  Eigen::Vector3d by_range = slope * residual.precision * residual.normal.dot(ray) * t.A;
  by_range.z() += influence * residual.precision * residual.normal.dot(quarterTurn(ray));
  out.by_current.col(current.beam[c]) += by_range;

  double by_offset = residual.normal.dot(ray);
  if (residual.surface != nullptr) {
    by_offset += addSurfaceDerivatives(problem, residual, t, out);
  } else {
    const ScannedPoints& reference = problem.reference().points;
    const auto r = static_cast<std::size_t>(residual.reference);
    const double shift = -residual.normal.dot(reference.ray[r]);
    out.by_reference.col(reference.beam[r]) += slope * residual.precision * shift * t.A;
    by_offset += shift;
  }
  const double w = problem.kernel().weight(t.e);
  out.squares.add(w, t);
  out.weight += w;
  out.by_range_offset.add(w, residual, t, by_offset);
  const Eigen::Vector2d by_duration = x.C * problem.current().bySweepDuration(c) -
                                      problem.reference().bySweepDuration(static_cast<std::size_t>(residual.reference));
  out.by_sweep_duration.add(w, residual, t, residual.normal.dot(by_duration));
  addPull(w, residual, t, out.pulls);
}

LossDerivatives differentiate(const AlignmentProblem& problem, const RigidMotion& x, const EstimationOptions& options) {
  LossDerivatives out(problem);
  out.pulls.reserve(problem.pairs().size());
  int block = 0;
  for (const Residual& residual : problem.residuals()) {
    const int beam = problem.current().points.beam[static_cast<std::size_t>(residual.current)];
    const int its_block = beam / options.correlated_beams;
    if (out.blocks.empty() || its_block != block) out.blocks.emplace_back();
    block = its_block;
    addDerivatives(problem, residual, x, out);
  }
  return out;
}

/// The covariance of the displacement that the residuals show by themselves: how far it moves when one block of beams
/// after the other is left out (jackknife). The plain scatter of the gradients would be too small, since a block with
/// much weight pulls the solution towards itself; and how beams of one block are correlated does not matter.
MatrixDD seenCovariance(const LossDerivatives& loss, const ObservableDirections& seen, const MatrixDD& hessian) {
  constexpr double kLeftOut = 0.9;  // not all of it: without a block the rest may not tell of a direction
  MatrixDD covariance = MatrixDD::Zero(seen.dimension(), seen.dimension());
  for (const BeamBlock& block : loss.blocks) {
    const MatrixDD rest = hessian - kLeftOut * (seen.basis.transpose() * block.hessian * seen.basis);
    const Eigen::VectorXd moved = rest.ldlt().solve(seen.basis.transpose() * block.gradient);
    covariance += moved * moved.transpose();
  }
  return covariance;
}

/// R_n: what is seen beyond what range noise explains. A variance is seen in so many samples to √(2/blocks); only what
/// exceeds it by twice that is matching noise, and times inflation: what all blocks have in common no block shows.
MatrixDD matchingNoise(const MatrixDD& range_covariance, const MatrixDD& seen_covariance, std::size_t blocks,
                       double inflation) {
  const Eigen::LLT<MatrixDD> range(range_covariance);
  const MatrixDD L = range.matrixL();
  MatrixDD whitened = range.matrixL().solve(seen_covariance);
  whitened = range.matrixL().solve(whitened.transpose()).eval();
  const Eigen::SelfAdjointEigenSolver<MatrixDD> eigen(symmetric(whitened));
  const double explained = 1.0 + 2.0 * std::sqrt(2.0 / static_cast<double>(blocks));
  const Eigen::VectorXd excess = inflation * (eigen.eigenvalues().array() - explained).max(0.0);
  const MatrixDD half = L * eigen.eigenvectors();
  return half * excess.asDiagonal() * half.transpose();
}

/// Residuals that are larger than the noise tell less.
ConstantEvidence rangeOffset(const AlignmentProblem& problem, const LossDerivatives& loss,
                             const ObservableDirections& seen) {
  // Of surfaces fitted across what is not straight, as far as noise lets them: by simulation 1 to 4 mm for 1 cm of
  // noise, which turn a displacement by next to nothing.
  constexpr double kBias = 20.0;  // [1/m]
  // Less than this, a residual's derivative by the offset (1: of a wall seen from one side, then from the other) is not
  // of the motion but of noise in directions of surfaces. That is the residuals' own noise, so it would tell of an
  // offset in every pair of scans that are near each other: 8 cm, after a while of scans that are compared with the
  // last one.
  constexpr double kDerivativeNoise = 0.03;
  const ConstantEvidence told = loss.evidence(loss.by_range_offset, seen);
  const double noise = std::max(problem.reference().range_noise, problem.current().range_noise);
  const double derivative = noise * std::sqrt(told.information / loss.weight);  // rms, the displacement eliminated
  if (derivative < kDerivativeNoise) return {};
  return {told.value, told.information / loss.excess(), kBias * noise * noise};
}

ConstantEvidence sweepDuration(const LossDerivatives& loss, const ObservableDirections& seen) {
  // On recorded logs turns to the left, turns to the right and ways straight on tell durations that differ by so much.
  constexpr double kBias = 0.005;  // [s]
  const ConstantEvidence told = loss.evidence(loss.by_sweep_duration, seen);
  return {told.value, told.information / loss.excess(), kBias};
}

}  // namespace

std::optional<DisplacementEstimate> estimateDisplacement(const AlignmentProblem& problem, const SE2& start,
                                                         const EstimationOptions& options) {
  const NormalEquations equations = problem.normalEquations(start);
  const ObservableDirections seen = observableDirections(equations, options.observability);
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
  z.matching_noise = matchingNoise(z.covariance(), seenCovariance(loss, seen, hessian), loss.blocks.size(),
                                   options.matching_inflation);
  estimate.decisive = decisivePlace(loss.pulls, problem.current().points, loss.squares.information(), seen,
                                    equations.lever, options.place_size);
  z.matching_noise += placeNoise(z, estimate.decisive, options.place_std);
  estimate.range_offset = rangeOffset(problem, loss, seen);
  estimate.sweep_duration = sweepDuration(loss, seen);
  return estimate;
}

MatrixDD placeNoise(const Displacement& displacement, const DecisivePlace& place, double std) {
  const Eigen::Matrix<double, Eigen::Dynamic, 2, 0, 3, 2> moved = std * displacement.observable * place.influence;
  return moved * moved.transpose();
}

Displacement meanOfBothWays(const Displacement& there, const Displacement& back) {
  Eigen::Matrix3d by_back;
  const SE2 inverted = inverse(back.reference_from_current, &by_back);
  const Eigen::Matrix3d to_coordinates = there.observable;
  const Eigen::Matrix3d A = to_coordinates * by_back * Eigen::Matrix3d(back.observable).inverse();
  const Eigen::Vector3d difference = error(inverted, there.reference_from_current);
  const Eigen::Vector3d d = to_coordinates * difference;
  Displacement mean = there;
  mean.reference_from_current = corrected(there.reference_from_current, 0.5 * difference);
  mean.J_reference = 0.5 * (there.J_reference + A * back.J_current);
  mean.J_current = 0.5 * (there.J_current + A * back.J_reference);
  mean.matching_noise =
      symmetric(0.5 * (there.matching_noise + A * back.matching_noise * A.transpose()) + 0.5 * d * d.transpose());
  return mean;
}

}  // namespace sckf
