#include "sckf_odometry/pipeline/reference_scans.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sckf {

bool isVague(const DisplacementPrediction& prediction) {
  constexpr double kFar = 0.3;     // [m]
  constexpr double kTurned = 0.1;  // [rad]
  const auto& P = prediction.covariance;
  return P(0, 0) + P(1, 1) > kFar * kFar || P(2, 2) > kTurned * kTurned;
}

std::vector<std::size_t> ReferenceScans::clonesOf(std::size_t laser) const {
  std::vector<std::size_t> clones;
  for (std::size_t clone = 0; clone < references_.size(); ++clone) {
    if (references_[clone].laser == laser) clones.push_back(clone);
  }
  return clones;
}

std::optional<std::size_t> ReferenceScans::newestOf(std::size_t laser) const {
  const std::vector<std::size_t> clones = clonesOf(laser);
  return clones.empty() ? std::nullopt : std::optional(clones.front());
}

void ReferenceScans::add(std::shared_ptr<const PreparedScan> scan, std::size_t laser, int kept, FusionMethod& filter) {
  references_.push_front({std::move(scan), laser});
  if (references_.size() > filter.clones()) references_.resize(filter.clones());  // of a method that keeps only one
  std::vector<std::size_t> clones = clonesOf(laser);
  for (; clones.size() > static_cast<std::size_t>(kept); clones.pop_back()) {
    forget(clones.back(), filter);
  }
}

void ReferenceScans::forget(std::size_t clone, FusionMethod& filter) {
  filter.forget(clone);
  references_.erase(references_.begin() + static_cast<std::ptrdiff_t>(clone));
}

std::vector<std::size_t> ReferenceScans::worthComparing(std::size_t laser, const FusionMethod& filter,
                                                        const ReferenceOptions& options) const {
  constexpr double kFartherIfVague = 2.0;  // those from before the pose became so uncertain may be out of reach by now
  const std::vector<std::size_t> own = clonesOf(laser);
  std::vector<std::pair<double, std::size_t>> near;  // distance as a share of what is allowed
  for (std::size_t i = 1; i < own.size(); ++i) {
    const DisplacementPrediction prediction = filter.predictedDisplacementFrom(own[i]);
    const SE2& displacement = prediction.reference_from_current;
    const double reach = isVague(prediction) ? kFartherIfVague : 1.0;
    const double distance = std::hypot(displacement.translation().norm() / (reach * options.older_dist_linear),
                                       displacement.yaw / (reach * options.older_dist_angular));
    if (distance < 1.0) near.emplace_back(i == 1 ? 0.0 : distance, own[i]);
  }
  std::sort(near.begin(), near.end());
  std::vector<std::size_t> clones;
  for (const auto& [distance, clone] : near) {
    if (clones.size() < static_cast<std::size_t>(options.older_compared)) clones.push_back(clone);
  }
  return clones;
}

}  // namespace sckf
