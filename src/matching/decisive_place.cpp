#include "sckf_odometry/matching/decisive_place.h"

#include <Eigen/LU>
#include <Eigen/SVD>

namespace sckf {

namespace {

/// The residuals of points that are no farther than size from the point of one that is the first of them. Between them
/// the scan may see what is behind, as between two legs.
template <typename Visit>
void forEachOfPlace(const AlignmentProblem& problem, std::size_t begin, double size, const Visit& visit) {
  const std::vector<Residual>& residuals = problem.residuals();
  const ScannedPoints& points = problem.current().points;
  const auto first = static_cast<std::size_t>(residuals[begin].current);
  const Eigen::Vector2d beam = points.range[first] * points.ray[first];
  for (std::size_t k = begin; k < residuals.size(); ++k) {
    const auto other = static_cast<std::size_t>(residuals[k].current);
    const double passes_by = quarterTurn(points.ray[other]).dot(beam);  // so far, if rays have length 1
    if (passes_by * passes_by > size * size * points.ray[other].squaredNorm()) break;
    if ((points.point[other] - points.point[first]).squaredNorm() <= size * size) visit(k);
  }
}

}  // namespace

double DecisivePlace::share() const {
  const Eigen::Matrix2d translation = influence.topRows<2>();
  return Eigen::JacobiSVD<Eigen::Matrix2d>(translation).singularValues()(0);
}

DecisivePlace decisivePlace(const AlignmentProblem& problem, const SE2& x, const ObservableDirections& seen,
                            double lever, double size) {
  using Matrix32 = Eigen::Matrix<double, 3, 2>;
  constexpr double kStep = 0.1;  // of the size: places begin so far from each other, since looking at all takes long
  const RigidMotion motion(x);
  const std::vector<Residual>& residuals = problem.residuals();
  if (residuals.empty()) return {};
  std::vector<Matrix32> by_position;  // of its point: ∂²L/∂x∂p, weights fixed
  by_position.reserve(residuals.size());
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (const Residual& residual : residuals) {
    const ResidualTerms t = problem.terms(residual, motion);
    const Eigen::Vector3d weighted = problem.kernel().weight(t.e) * t.A;
    by_position.emplace_back(weighted * (residual.precision * residual.normal).transpose());
    information += weighted * t.A.transpose();
  }
  const auto pointOf = [&](std::size_t k) -> const Eigen::Vector2d& {
    return problem.current().points.point[static_cast<std::size_t>(residuals[k].current)];
  };
  const auto& B = seen.basis;
  const Eigen::Matrix3d response = -B * (B.transpose() * information * B).inverse() * B.transpose();

  const Eigen::Vector3d in_metres(1.0, 1.0, lever);
  const double step = kStep * size;
  DecisivePlace decisive;
  std::size_t decisive_begin = 0;
  double most = -1.0;
  std::size_t before = residuals.size();
  for (std::size_t begin = 0; begin < residuals.size(); ++begin) {
    if (before < begin && (pointOf(begin) - pointOf(before)).squaredNorm() < step * step) continue;
    before = begin;
    Matrix32 sum = Matrix32::Zero();
    forEachOfPlace(problem, begin, size, [&](std::size_t k) { sum += by_position[k]; });
    const Matrix32 influence = response * sum;
    const double moved = (in_metres.asDiagonal() * influence).squaredNorm();
    if (!(moved > most)) continue;  // or is no number
    most = moved;
    decisive_begin = begin;
    decisive.influence = influence;
  }
  forEachOfPlace(problem, decisive_begin, size, [&](std::size_t k) {
    const int point = residuals[k].current;
    if (decisive.points.empty() || decisive.points.back() != point) decisive.points.push_back(point);
  });
  return decisive;
}

}  // namespace sckf
