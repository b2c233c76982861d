#include "sckf_odometry/matching/decisive_place.h"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>

namespace sckf {

namespace {

using Matrix32 = Eigen::Matrix<double, 3, 2>;

/// A point that pulls, with all that tells whether another one stands with it: side by side, since every point is
/// looked at many times.
struct Standing {
  Eigen::Vector2d at;      // in base_link
  Eigen::Vector2d beam;    // from the laser to it
  Eigen::Vector2d across;  // its ray turned to the left, of length 1
  Matrix32 by_position;
};

std::vector<Standing> standing(const std::vector<PointPull>& pulls, const ScannedPoints& points) {
  std::vector<Standing> all;
  all.reserve(pulls.size());
  for (const PointPull& pull : pulls) {
    const auto i = static_cast<std::size_t>(pull.point);
    const Eigen::Vector2d& ray = points.ray[i];
    all.push_back({points.point[i], points.range[i] * ray, quarterTurn(ray.normalized()), pull.by_position});
  }
  return all;
}

/// Visits the indices of those that are no farther than size from one that is the first of them. Between them the scan
/// may see what is behind, as between two legs.
template <typename Visit>
void forEachOfPlace(const std::vector<Standing>& all, std::size_t first, double size, const Visit& visit) {
  const Eigen::Vector2d at = all[first].at;
  const Eigen::Vector2d beam = all[first].beam;
  for (std::size_t k = first; k < all.size(); ++k) {
    if (std::abs(all[k].across.dot(beam)) > size) return;  // so far its beam passes by
    if ((all[k].at - at).squaredNorm() <= size * size) visit(k);
  }
}

}  // namespace

double DecisivePlace::share() const {
  const Eigen::Matrix2d translation = influence.topRows<2>();
  return Eigen::JacobiSVD<Eigen::Matrix2d>(translation).singularValues()(0);
}

DecisivePlace decisivePlace(const std::vector<PointPull>& pulls, const ScannedPoints& current,
                            const Eigen::Matrix3d& information, const ObservableDirections& seen, double lever,
                            double size) {
  constexpr double kStep = 0.1;  // of the size: places begin so far from each other, since looking at all takes long
  if (pulls.empty()) return {};
  const auto& B = seen.basis;
  const Eigen::Matrix3d response = -B * (B.transpose() * information * B).inverse() * B.transpose();
  const Eigen::Vector3d in_metres(1.0, 1.0, lever);
  const Eigen::Matrix3d response_in_metres = in_metres.asDiagonal() * response;

  const std::vector<Standing> all = standing(pulls, current);
  const double step = kStep * size;
  std::size_t decisive = 0;
  double most = -1.0;
  std::size_t before = all.size();
  Matrix32 pull_of_decisive = Matrix32::Zero();
  for (std::size_t first = 0; first < all.size(); ++first) {
    if (before < first && (all[first].at - all[before].at).squaredNorm() < step * step) continue;
    before = first;
    Matrix32 sum = Matrix32::Zero();
    forEachOfPlace(all, first, size, [&](std::size_t k) { sum += all[k].by_position; });
    const double moved = (response_in_metres * sum).squaredNorm();
    if (!(moved > most)) continue;  // or is no number
    most = moved;
    decisive = first;
    pull_of_decisive = sum;
  }
  DecisivePlace place;
  place.influence = response * pull_of_decisive;
  forEachOfPlace(all, decisive, size, [&](std::size_t k) { place.points.push_back(pulls[k].point); });
  return place;
}

}  // namespace sckf
