#include "sckf_odometry/pipeline/landmarks.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "sckf_odometry/pipeline/chi_squared.h"
#include "sckf_odometry/pipeline/reference_scans.h"

namespace sckf {

namespace {

constexpr std::size_t kForgotten = 5;  // scans after which a candidate that is not seen again is none

double largestStd(const Eigen::Matrix2d& covariance) {
  return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(covariance).eigenvalues()(1));
}

/// Of where a landmark is expected: of a corner in any direction, of a line across it.
double stdOf(const Innovation& r) {
  return r.covariance.rows() == 3 ? largestStd(r.covariance.topLeftCorner<2, 2>()) : std::sqrt(r.covariance(0, 0));
}

/// Volume of the ellipsoid of what is seen, squared.
double uncertainty(const Sighting& sighting) {
  const Displacement::MatrixD3 S = sighting.seen();
  return Displacement::MatrixDD(S * sighting.covariance * S.transpose()).determinant();
}

}  // namespace

const std::vector<std::string>& landmarkUses() {
  static const std::vector<std::string> uses{"none", "corners", "lines", "corners_and_lines"};
  return uses;
}

std::shared_ptr<const PreparedScan> Landmarks::claim(std::shared_ptr<const PreparedScan> scan,
                                                     const LandmarkStates& filter, const SurfaceOptions& surface) {
  ++scans_;
  scan_ = std::move(scan);
  sights_.clear();
  std::vector<bool> aside(scan_->size(), false);
  if (options_.corners()) {
    for (const Corner& corner : findCorners(*scan_, options_.corner)) sights_.emplace_back(corner);
    claim(0, filter, aside);
  }
  // Corners come first: they tell all that lines tell, and where along the lines, too.
  corners_have_ = aside;
  if (options_.lines()) {
    const std::size_t corners = sights_.size();
    for (const Line& line : findLines(*scan_, aside, options_.line)) sights_.emplace_back(line);
    claim(corners, filter, aside);
  }
  if (std::find(aside.begin(), aside.end(), true) == aside.end()) return scan_;
  return setAside(*scan_, aside, surface);
}

/// Of the sights from `first` on those that are, or may become, landmarks; their points are aside then.
void Landmarks::claim(std::size_t first, const LandmarkStates& filter, std::vector<bool>& aside) {
  for (const Association& a : compatible(filter, Stage::kClaim)) {
    if (a.sight >= first) sights_[a.sight].claimed = true;
  }
  for (std::size_t s = first; s < sights_.size(); ++s) {
    const Candidate* candidate = candidateFor(moved(filter.pose(), sights_[s].feature()));
    if (candidate != nullptr && candidate->sightings + 1 >= options_.sightings) sights_[s].claimed = true;
  }
  if (!options_.only) {
    const auto taken = static_cast<double>(std::count(aside.begin(), aside.end(), true));
    giveWay(first, options_.max_share * static_cast<double>(scan_->size()) - taken);
  }
  for (std::size_t s = first; s < sights_.size(); ++s) {
    const Sight& sight = sights_[s];
    if (!sight.claimed) continue;
    for (int i = sight.first; i <= sight.last; i += sight.every) aside[static_cast<std::size_t>(i)] = true;
  }
}

/// The match needs points, too: of the sights from `first` on the least certain leave theirs to it.
void Landmarks::giveWay(std::size_t first, double left) {
  std::vector<Sight*> claimed;
  for (std::size_t s = first; s < sights_.size(); ++s) {
    if (sights_[s].claimed) claimed.push_back(&sights_[s]);
  }
  std::sort(claimed.begin(), claimed.end(),
            [](auto* a, auto* b) { return uncertainty(a->sighting) < uncertainty(b->sighting); });
  for (Sight* sight : claimed) {
    sight->gives_way = sight->points() > left;
    sight->claimed = !sight->gives_way;
    if (sight->claimed) left -= sight->points();
  }
}

int Landmarks::update(LandmarkStates& filter) {
  // The most certain first: it makes the others more certain.
  for (auto all = compatible(filter, Stage::kUpdate); const Association* next = mostCertain(all, filter);
       all = compatible(filter, Stage::kUpdate)) {
    use(*next, filter);
  }
  const auto used = std::count_if(known_.begin(), known_.end(), [this](const Known& k) { return k.seen == scans_; });
  giveUpMissed(filter);
  beginNew(filter);
  return static_cast<int>(used);
}

void Landmarks::use(const Association& association, LandmarkStates& filter) {
  Sight& sight = sights_[association.sight];
  Known& known = known_[association.landmark];
  filter.update(association.landmark, sight.sighting);
  if (sight.shape.is_line) {
    Feature line = landmark(association.landmark, filter);
    grow(line, moved(filter.pose(), sight.feature()));
    known.shape = line.shape;
  }
  sight.used = true;
  known.farthest = std::max(known.farthest, sight.farthest());
  known.misses = 0;
  known.seen = scans_;
}

bool Landmarks::isOf(Stage stage, const Sight& sight) {
  if (stage == Stage::kExcuse) return sight.gives_way;
  return !sight.used && (sight.claimed || stage == Stage::kClaim);
}

/// Of what is seen and of landmarks that are free yet, those that may belong together. What is claimed before the
/// displacement, at a pose that only the wheels tell, is looked at again after it. Of a line a scan may see several
/// pieces.
std::vector<Landmarks::Association> Landmarks::compatible(const LandmarkStates& filter, Stage stage) const {
  const double farthest = 4.0 * options_.max_std;
  std::vector<Association> all;
  for (std::size_t l = 0; l < known_.size(); ++l) {
    if (known_[l].seen == scans_ && !known_[l].shape.is_line) continue;
    const Feature expected = moved(inverse(filter.pose()), landmark(l, filter));
    for (std::size_t s = 0; s < sights_.size(); ++s) {
      const Sight& sight = sights_[s];
      if (!isOf(stage, sight) || !areOfAKind(expected, sight.feature())) continue;
      if (distance(expected, sight.feature()) > farthest) continue;
      const Innovation r = filter.innovation(l, sight.sighting);
      const double std = stdOf(r);
      const bool is_certain = stage != Stage::kUpdate || std <= options_.max_std;
      const double bound = chiSquared(r.residual.size(), options_.probability);
      if (is_certain && r.nis() <= bound) all.push_back({s, l, std});
    }
  }
  return all;
}

/// One thing seen is not two landmarks, nor the reverse. But what a line shows on either side of a gap is both it.
bool Landmarks::excludeEachOther(const Association& a, const Association& b, const LandmarkStates& filter) const {
  if ((a.sight == b.sight) == (a.landmark == b.landmark)) return false;
  if (!sights_[a.sight].shape.is_line) return true;
  if (a.sight == b.sight) return lieSideBySide(landmark(a.landmark, filter), landmark(b.landmark, filter));
  return lieSideBySide(sights_[a.sight].feature(), sights_[b.sight].feature());
}

/// Of those that no other one excludes.
const Landmarks::Association* Landmarks::mostCertain(const std::vector<Association>& all,
                                                     const LandmarkStates& filter) const {
  const Association* best = nullptr;
  for (const Association& a : all) {
    const bool has_rival =
        std::any_of(all.begin(), all.end(), [&](const Association& b) { return excludeEachOther(a, b, filter); });
    if (!has_rival && (best == nullptr || a.std < best->std)) best = &a;
  }
  return best;
}

const Landmarks::Candidate* Landmarks::candidateFor(const Feature& in_odom) const {
  const auto found = std::find_if(candidates_.begin(), candidates_.end(),
                                  [&](const Candidate& candidate) { return areAlike(candidate.in_odom, in_odom); });
  return found == candidates_.end() ? nullptr : &*found;
}

/// A landmark should be seen from where it has been seen before, unless something hides it; a line, if more than half
/// of it is in view.
bool Landmarks::shouldSee(const Feature& in_base, double farthest) const {
  const FeatureShape& shape = in_base.shape;
  if (!shape.is_line) return isCornerInView(in_base.frame, scan_->points, farthest);
  const double enough = std::max(options_.line.min_length, 0.5 * (shape.to - shape.from));
  return stretchInView(in_base, scan_->points, corners_have_, farthest) > enough;
}

void Landmarks::giveUp(std::size_t landmark, LandmarkStates& filter) {
  filter.forgetLandmark(landmark);
  known_.erase(known_.begin() + static_cast<std::ptrdiff_t>(landmark));
}

void Landmarks::giveUpMissed(LandmarkStates& filter) {
  std::vector<bool> excused(known_.size(), false);
  for (const Association& a : compatible(filter, Stage::kExcuse)) excused[a.landmark] = true;
  for (std::size_t l = known_.size(); l-- > 0;) {
    Known& known = known_[l];
    if (known.seen == scans_ || excused[l]) continue;
    if (!shouldSee(moved(inverse(filter.pose()), landmark(l, filter)), known.farthest)) continue;
    if (++known.misses >= options_.misses) giveUp(l, filter);
  }
}

bool Landmarks::isNearLandmark(const Feature& in_odom, const LandmarkStates& filter) const {
  for (std::size_t l = 0; l < known_.size(); ++l) {
    if (areAlike(landmark(l, filter), in_odom)) return true;
  }
  return false;
}

void Landmarks::beginNew(LandmarkStates& filter) {
  for (const Sight& sight : sights_) {
    const Feature in_odom = moved(filter.pose(), sight.feature());
    if (sight.used || isNearLandmark(in_odom, filter)) continue;
    const Candidate* candidate = candidateFor(in_odom);
    if (!sight.claimed || candidate == nullptr || candidate->sightings + 1 < options_.sightings) {
      remember(in_odom);
      continue;
    }
    while (known_.size() >= static_cast<std::size_t>(options_.max)) {
      const auto oldest = std::min_element(known_.begin(), known_.end(),
                                           [](const Known& a, const Known& b) { return a.seen < b.seen; });
      giveUp(static_cast<std::size_t>(oldest - known_.begin()), filter);
    }
    candidates_.erase(candidates_.begin() + (candidate - candidates_.data()));
    filter.addLandmark(sight.sighting);
    known_.push_back({sight.shape, sight.farthest(), 0, scans_});
  }
  const auto is_forgotten = [this](const Candidate& candidate) { return candidate.seen + kForgotten < scans_; };
  candidates_.erase(std::remove_if(candidates_.begin(), candidates_.end(), is_forgotten), candidates_.end());
}

void Landmarks::remember(const Feature& in_odom) {
  const Candidate* known = candidateFor(in_odom);
  if (known == nullptr) {
    candidates_.push_back({in_odom, 1, scans_});
    return;
  }
  Candidate& candidate = candidates_[static_cast<std::size_t>(known - candidates_.data())];
  if (candidate.seen == scans_) return;  // by another one of this scan
  candidate = {in_odom, candidate.sightings + 1, scans_};
}

std::vector<LandmarkView> Landmarks::views(const LandmarkStates& filter) const {
  std::vector<LandmarkView> views;
  for (std::size_t l = 0; l < known_.size(); ++l) {
    const FeatureShape& shape = known_[l].shape;
    views.push_back({filter.landmark(l), filter.landmarkCovariance(l), known_[l].seen == scans_, shape.is_line,
                     shape.from, shape.to});
  }
  return views;
}

}  // namespace sckf
