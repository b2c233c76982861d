#include "sckf_odometry/matching/alignment_problem.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sckf {

namespace {

constexpr double kContradiction = 3.0;  // loss of a point that the other scan has looked through

double square(double v) { return v * v; }

/// From a to b, both of length 1: the sine, which is the angle for turns that matter, and a little less for others.
double turnBetween(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return quarterTurn(a).dot(b); }

/// From point i to the nearer of its neighbours in the order of the beams.
Eigen::Vector2d toNextPoint(const ScannedPoints& points, std::size_t i) {
  if (points.size() == 1) return Eigen::Vector2d::Zero();
  if (i == 0) return points.point[1] - points.point[0];
  const Eigen::Vector2d before = points.point[i - 1] - points.point[i];
  if (i + 1 == points.size()) return before;
  const Eigen::Vector2d after = points.point[i + 1] - points.point[i];
  return after.squaredNorm() < before.squaredNorm() ? after : before;
}

}  // namespace

AlignmentProblem::AlignmentProblem(const PreparedScan& reference, const PreparedScan& current,
                                   const SE2& reference_from_current, double max_distance, const PairOptions& options)
    : AlignmentProblem(reference, current, reference_from_current,
                       NearestNeighbours(reference, current).pairs(RigidMotion(reference_from_current), max_distance),
                       options) {}

AlignmentProblem::AlignmentProblem(const PreparedScan& reference, const PreparedScan& current,
                                   const SE2& reference_from_current, const std::vector<Pair>& neighbours,
                                   const PairOptions& options)
    : reference_(reference), current_(current), paired_at_(reference_from_current) {
  const RigidMotion motion(reference_from_current);
  pairs_.reserve(neighbours.size());
  residuals_.reserve(2 * neighbours.size());
  for (const Pair& pair : neighbours) {
    if (reference_.surface[static_cast<std::size_t>(pair.reference)].valid()) {
      addSurfacePair(pair, motion, options);
    } else if (!current_.surface[static_cast<std::size_t>(pair.current)].valid()) {
      addPointPair(pair, options);
    }
  }
  weighByTurn(motion, options);
  fitKernel(motion, options);
}

void AlignmentProblem::addSurfacePair(const Pair& pair, const RigidMotion& reference_from_current,
                                      const PairOptions& options) {
  const auto i = static_cast<std::size_t>(pair.reference);
  const auto j = static_cast<std::size_t>(pair.current);
  const Surface& surface = reference_.surface[i];
  const auto& [C, t] = reference_from_current;
  const Eigen::Vector2d ray = C * current_.points.ray[j];
  if (surface.normal.dot(ray) > 0.0) return;  // the current scan would see the surface from behind
  const Surface& seen = current_.surface[j];
  if (seen.valid() && surface.normal.dot(C * seen.normal) < std::cos(options.max_normal_angle)) return;

  const double along = surface.tangent().dot(C * current_.points.point[j] + t - surface.centroid);
  const double point_variance = varianceAcross(surface.normal, reference_.points.ray[i], reference_.range_noise);
  const double line_variance = point_variance * (1.0 / surface.size() + square(along) / surface.spread);
  const double variance =
      varianceAcross(surface.normal, ray, current_.range_noise) + line_variance + square(options.surface_roughness);
  pairs_.push_back(pair);
  residuals_.push_back({pair.reference, pair.current, surface.normal, surface.centroid, &surface,
                        1.0 / std::sqrt(variance), (point_variance + square(kWallRoughness)) / surface.spread});
}

void AlignmentProblem::addPointPair(const Pair& pair, const PairOptions& options) {
  // Two scans never hit the same physical point: along the line to its neighbour, where the surface probably runs, a
  // point is known no better than the points are spaced.
  const auto i = static_cast<std::size_t>(pair.reference);
  const Eigen::Vector2d step = toNextPoint(reference_.points, i);
  const double variance = square(options.point_std) + square(reference_.range_noise) + square(current_.range_noise);
  const Eigen::Vector2d along = step.normalized();
  const Eigen::Vector2d& anchor = reference_.points.point[i];
  pairs_.push_back(pair);
  residuals_.push_back({pair.reference, pair.current, quarterTurn(along), anchor, nullptr,
                        1.0 / std::sqrt(variance + 0.06 * step.squaredNorm())});
  residuals_.push_back(
      {pair.reference, pair.current, along, anchor, nullptr, 1.0 / std::sqrt(variance + step.squaredNorm())});
}

/// What few beams see of a step in a wall is straight within noise, too, and from the next place it is another surface:
/// along a corridor nothing else would seem to tell of the way. Most surfaces are turned by what the yaw is off.
void AlignmentProblem::weighByTurn(const RigidMotion& reference_from_current, const PairOptions& options) {
  std::vector<std::pair<double, Residual*>> turns;
  turns.reserve(residuals_.size());
  for (Residual& residual : residuals_) {
    const Surface& seen = current_.surface[static_cast<std::size_t>(residual.current)];
    if (residual.surface == nullptr || !seen.valid()) continue;
    turns.emplace_back(turnBetween(residual.normal, reference_from_current.C * seen.normal), &residual);
  }
  if (turns.empty()) return;
  const auto middle = turns.begin() + static_cast<std::ptrdiff_t>(turns.size() / 2);
  std::nth_element(turns.begin(), middle, turns.end());
  const double median = middle->first;
  for (const auto& [turn, residual] : turns)
    residual->precision /= std::sqrt(1.0 + square((turn - median) / options.normal_agreement));
}

void AlignmentProblem::fitKernel(const RigidMotion& reference_from_current, const PairOptions& options) {
  constexpr double kGaussian = 1.4826;
  constexpr double kMaxScale = 3.0;  // beyond, the pairs are wrong and not the surfaces rough
  std::vector<double> deviations;
  deviations.reserve(residuals_.size());
  for (const Residual& residual : residuals_) {
    if (residual.surface != nullptr) deviations.push_back(std::abs(terms(residual, reference_from_current).e));
  }
  if (!deviations.empty()) {
    const auto middle = deviations.begin() + static_cast<std::ptrdiff_t>(deviations.size() / 2);
    std::nth_element(deviations.begin(), middle, deviations.end());
    scale_ = std::clamp(kGaussian * *middle, 1.0, kMaxScale);
  }
  kernel_.c = options.robust_width * scale_;
}

double AlignmentProblem::overlap() const {
  return static_cast<double>(pairs_.size()) / static_cast<double>(current_.size());
}

int AlignmentProblem::contradictions() const {
  if (!contradictions_) contradictions_ = countContradictions();
  return *contradictions_;
}

int AlignmentProblem::countContradictions() const {
  const auto countOf = [](const PreparedScan& scan, const std::vector<bool>& paired, const PreparedScan& other,
                          const RigidMotion& other_from_scan) {
    int count = 0;
    for (std::size_t i = 0; i < scan.size(); ++i) {
      if (!paired[i] && other.free_space.contains(other_from_scan * scan.points.point[i])) ++count;
    }
    return count;
  };
  std::vector<bool> of_reference(reference_.size(), false);
  std::vector<bool> of_current(current_.size(), false);
  for (const Pair& pair : pairs_) {
    of_reference[static_cast<std::size_t>(pair.reference)] = true;
    of_current[static_cast<std::size_t>(pair.current)] = true;
  }
  return countOf(current_, of_current, reference_, RigidMotion(paired_at_)) +
         countOf(reference_, of_reference, current_, RigidMotion(inverse(paired_at_)));
}

double AlignmentProblem::agreement() const {
  const auto paired = static_cast<double>(pairs_.size());
  return paired / std::max(1.0, paired + contradictions());
}

NormalEquations AlignmentProblem::normalEquations(const SE2& reference_from_current) const {
  const RigidMotion motion(reference_from_current);
  WeightedSquares squares;
  Eigen::Matrix3d spurious = Eigen::Matrix3d::Zero();
  double lever_square_sum = 0.0;
  for (const Residual& residual : residuals_) {
    const ResidualTerms t = terms(residual, motion);
    const double w = kernel_.weight(t.e);
    squares.add(w, t);
    lever_square_sum += t.lever.squaredNorm();
    if (residual.surface == nullptr) continue;
    const Eigen::Vector3d dA = derivativeByNormal(residual, t);
    spurious += w * residual.normal_variance * dA * dA.transpose();
  }
  const double weight = 1.0 / square(scale_);
  return {weight * squares.information(), weight * squares.gradient(), weight * spurious,
          std::sqrt(lever_square_sum / static_cast<double>(residuals_.size()))};
}

double AlignmentProblem::loss(const SE2& reference_from_current) const {
  const RigidMotion motion(reference_from_current);
  const RobustKernel kernel{2.0};  // one for all alignments, whatever their own scale
  double sum = kContradiction * contradictions();
  for (const Residual& residual : residuals_) {
    const double share = residual.surface != nullptr ? 1.0 : 0.5;
    sum += share * std::min(kContradiction, kernel.loss(terms(residual, motion).e));
  }
  return sum;
}

double AlignmentProblem::misfit(const SE2& reference_from_current) const {
  constexpr double kFewest = 0.3;  // of the points: so many are compared in any case, as contradictions
  const double missing =
      std::max(0.0, kFewest * static_cast<double>(current_.size()) - static_cast<double>(pairs_.size()));
  const double compared = static_cast<double>(pairs_.size()) + contradictions() + missing;
  return (loss(reference_from_current) + kContradiction * missing) / compared;
}

}  // namespace sckf
