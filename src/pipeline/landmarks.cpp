#include "sckf_odometry/pipeline/landmarks.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "sckf_odometry/pipeline/chi_squared.h"
#include "sckf_odometry/pipeline/reference_scans.h"

namespace sckf {

namespace {

constexpr double kSameAngle = 0.3;     // [rad] between the walls, and of the corner's yaw: corners of a kind
constexpr double kSamePlace = 0.3;     // [m] within which there is one landmark, and one candidate
constexpr std::size_t kForgotten = 5;  // scans after which a candidate that is not seen again is none

Sighting sighting(const Corner& corner) { return {corner.base_from_corner, corner.covariance}; }

bool areAlike(const SE2& a, const SE2& b) {
  const Eigen::Vector3d e = error(a, b);
  return e.head<2>().norm() < kSamePlace && std::abs(e.z()) < kSameAngle;
}

double largestStd(const Eigen::Matrix2d& covariance) {
  return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(covariance).eigenvalues()(1));
}

/// What the robot's pose may be off, as an error of what it sees there.
Eigen::Matrix3d seenFrom(const Eigen::Matrix3d& slack, const SE2& base_from_landmark) {
  Eigen::Matrix3d J = Eigen::Matrix3d::Identity();
  J.topRightCorner<2, 1>() = quarterTurn(base_from_landmark.translation());
  return J * slack * J.transpose();
}

}  // namespace

const std::vector<std::string>& landmarkUses() {
  static const std::vector<std::string> uses{"none", "corners", "corners_only"};
  return uses;
}

std::shared_ptr<const PreparedScan> Landmarks::claim(std::shared_ptr<const PreparedScan> scan,
                                                     const MultiCloneFilter& filter, const ReferenceOptions& reference,
                                                     const SurfaceOptions& surface) {
  ++scans_;
  scan_ = std::move(scan);
  sights_.clear();
  for (Corner& corner : findCorners(*scan_, options_.corner)) sights_.push_back({std::move(corner)});
  for (const Association& a : compatible(filter, reference, Stage::kClaim)) sights_[a.sight].claimed = true;
  for (Sight& sight : sights_) {
    const Candidate* candidate = candidateFor(sight.corner, filter.pose());
    if (candidate != nullptr && candidate->sightings + 1 >= options_.sightings) sight.claimed = true;
  }
  if (options_.withDisplacements()) giveWay(scan_->size());

  std::vector<bool> aside(scan_->size(), false);
  for (const Sight& sight : sights_) {
    if (!sight.claimed) continue;
    std::fill(aside.begin() + sight.corner.first, aside.begin() + sight.corner.last + 1, true);
  }
  if (std::find(aside.begin(), aside.end(), true) == aside.end()) return scan_;
  return setAside(*scan_, aside, surface);
}

/// The match needs points, too: the least certain corners leave theirs to it.
void Landmarks::giveWay(std::size_t points) {
  std::vector<Sight*> claimed;
  for (Sight& sight : sights_) {
    if (sight.claimed) claimed.push_back(&sight);
  }
  const auto uncertainty = [](const Sight* sight) { return sight->corner.covariance.determinant(); };
  std::sort(claimed.begin(), claimed.end(), [&](auto* a, auto* b) { return uncertainty(a) < uncertainty(b); });
  double left = options_.max_share * static_cast<double>(points);
  for (Sight* sight : claimed) {
    const double wanted = sight->corner.last - sight->corner.first + 1;
    sight->claimed = wanted <= left;
    if (sight->claimed) left -= wanted;
  }
}

int Landmarks::update(MultiCloneFilter& filter, const ReferenceOptions& reference) {
  int used = 0;
  // The most certain first: it makes the others more certain.
  for (auto all = compatible(filter, reference, Stage::kUpdate); const Association* next = mostCertain(all);
       all = compatible(filter, reference, Stage::kUpdate)) {
    Sight& sight = sights_[next->sight];
    filter.update(next->landmark, sighting(sight.corner));
    sight.used = true;
    Known& known = known_[next->landmark];
    known.farthest = std::max(known.farthest, sight.corner.base_from_corner.translation().norm());
    known.misses = known.references = 0;
    known.seen = scans_;
    ++used;
  }
  giveUpMissed(filter);
  beginNew(filter);
  return used;
}

void Landmarks::countReference() {
  for (Known& known : known_) ++known.references;
}

/// By how much the robot may be off from where the landmark was last seen, beyond the filter's covariance.
Eigen::Matrix3d Landmarks::slackOf(const Known& known, const ReferenceOptions& reference) {
  if (known.references == 0) return Eigen::Matrix3d::Zero();
  return referenceSlack(static_cast<std::size_t>(known.references), reference);
}

/// Of corners and landmarks that are free yet, those that may belong together. What is claimed before the displacement,
/// at a pose that only the wheels tell, is looked at again after it.
std::vector<Landmarks::Association> Landmarks::compatible(const MultiCloneFilter& filter,
                                                          const ReferenceOptions& reference, Stage stage) const {
  const double farthest = 4.0 * options_.max_std;
  const double bound = chiSquared(3, options_.probability);
  const bool updates = stage == Stage::kUpdate;
  std::vector<Association> all;
  for (std::size_t l = 0; l < known_.size(); ++l) {
    if (known_[l].seen == scans_) continue;
    const SE2 expected = between(filter.pose(), filter.landmark(l));
    const Eigen::Matrix3d slack = seenFrom(slackOf(known_[l], reference), expected);
    for (std::size_t s = 0; s < sights_.size(); ++s) {
      const Corner& corner = sights_[s].corner;
      if (sights_[s].used || (updates && !sights_[s].claimed)) continue;
      if (std::abs(corner.angle - known_[l].angle) > kSameAngle) continue;
      if (error(corner.base_from_corner, expected).head<2>().norm() > farthest) continue;
      const Innovation r = filter.innovation(l, sighting(corner));
      const double std = largestStd(r.covariance.topLeftCorner<2, 2>());
      const bool is_certain = !updates || std <= options_.max_std;
      if (is_certain && r.nis(slack) <= bound) all.push_back({s, l, std});
    }
  }
  return all;
}

/// Of those of which neither the corner may be another landmark's nor the landmark another corner's.
const Landmarks::Association* Landmarks::mostCertain(const std::vector<Association>& all) {
  const Association* best = nullptr;
  for (const Association& a : all) {
    const auto rivals = std::count_if(all.begin(), all.end(), [&a](const Association& b) {
      return (a.sight == b.sight) != (a.landmark == b.landmark);
    });
    if (rivals == 0 && (best == nullptr || a.std < best->std)) best = &a;
  }
  return best;
}

const Landmarks::Candidate* Landmarks::candidateFor(const Corner& corner, const SE2& odom_from_base) const {
  const SE2 odom_from_corner = compose(odom_from_base, corner.base_from_corner);
  for (const Candidate& candidate : candidates_) {
    const bool is_of_a_kind = std::abs(candidate.angle - corner.angle) < kSameAngle;
    if (is_of_a_kind && areAlike(candidate.odom_from_corner, odom_from_corner)) return &candidate;
  }
  return nullptr;
}

/// A landmark should be seen from where it has been seen before, unless something hides it.
bool Landmarks::shouldSee(const SE2& base_from_landmark, double farthest) const {
  constexpr double kBeamWidth = 0.035;  // [rad]
  constexpr double kHidden = 0.3;       // [m]
  const ScannedPoints& points = scan_->points;
  if (points.size() == 0) return false;
  const Eigen::Vector2d origin = points.point.front() - points.range.front() * points.ray.front();
  const Eigen::Vector2d to_landmark = base_from_landmark.translation() - origin;
  const double distance = to_landmark.norm();
  if (distance > farthest) return false;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool is_on_beam = points.ray[i].dot(to_landmark) > std::cos(kBeamWidth) * distance;
    if (is_on_beam && points.range[i] > distance - kHidden) return true;
  }
  return false;
}

void Landmarks::giveUp(std::size_t landmark, MultiCloneFilter& filter) {
  filter.forgetLandmark(landmark);
  known_.erase(known_.begin() + static_cast<std::ptrdiff_t>(landmark));
}

void Landmarks::giveUpMissed(MultiCloneFilter& filter) {
  for (std::size_t l = known_.size(); l-- > 0;) {
    Known& known = known_[l];
    if (known.seen == scans_ || !shouldSee(between(filter.pose(), filter.landmark(l)), known.farthest)) continue;
    if (++known.misses >= options_.misses) giveUp(l, filter);
  }
}

bool Landmarks::isNearLandmark(const Corner& corner, const MultiCloneFilter& filter) const {
  const SE2 odom_from_corner = compose(filter.pose(), corner.base_from_corner);
  for (std::size_t l = 0; l < known_.size(); ++l) {
    if (areAlike(filter.landmark(l), odom_from_corner)) return true;
  }
  return false;
}

void Landmarks::beginNew(MultiCloneFilter& filter) {
  for (const Sight& sight : sights_) {
    if (sight.used || isNearLandmark(sight.corner, filter)) continue;
    const Candidate* candidate = candidateFor(sight.corner, filter.pose());
    if (!sight.claimed || candidate == nullptr || candidate->sightings + 1 < options_.sightings) {
      remember(sight.corner, filter.pose());
      continue;
    }
    while (known_.size() >= static_cast<std::size_t>(options_.max)) {
      const auto oldest = std::min_element(known_.begin(), known_.end(),
                                           [](const Known& a, const Known& b) { return a.seen < b.seen; });
      giveUp(static_cast<std::size_t>(oldest - known_.begin()), filter);
    }
    candidates_.erase(candidates_.begin() + (candidate - candidates_.data()));
    filter.addLandmark(sighting(sight.corner));
    known_.push_back({sight.corner.angle, sight.corner.base_from_corner.translation().norm(), 0, 0, scans_});
  }
  const auto is_forgotten = [this](const Candidate& candidate) { return candidate.seen + kForgotten < scans_; };
  candidates_.erase(std::remove_if(candidates_.begin(), candidates_.end(), is_forgotten), candidates_.end());
}

void Landmarks::remember(const Corner& corner, const SE2& odom_from_base) {
  const Candidate* known = candidateFor(corner, odom_from_base);
  const SE2 odom_from_corner = compose(odom_from_base, corner.base_from_corner);
  if (known == nullptr) {
    candidates_.push_back({odom_from_corner, corner.angle, 1, scans_});
    return;
  }
  Candidate& candidate = candidates_[static_cast<std::size_t>(known - candidates_.data())];
  if (candidate.seen == scans_) return;  // by another corner of this scan
  candidate = {odom_from_corner, corner.angle, candidate.sightings + 1, scans_};
}

std::vector<LandmarkView> Landmarks::views(const MultiCloneFilter& filter) const {
  std::vector<LandmarkView> views;
  for (std::size_t l = 0; l < known_.size(); ++l) {
    views.push_back({filter.landmark(l), filter.landmarkCovariance(l).topLeftCorner<2, 2>(), known_[l].seen == scans_});
  }
  return views;
}

}  // namespace sckf
