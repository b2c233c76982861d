#include "sckf_odometry/pipeline/reference_scans.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sckf {

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
    filter.forget(clones.back());
    references_.erase(references_.begin() + static_cast<std::ptrdiff_t>(clones.back()));
  }
}

std::vector<std::size_t> ReferenceScans::worthComparing(std::size_t laser, const FusionMethod& filter,
                                                        const ReferenceOptions& options) const {
  const std::vector<std::size_t> own = clonesOf(laser);
  std::vector<std::pair<double, std::size_t>> near;  // distance as a share of what is allowed
  for (std::size_t i = 1; i < own.size(); ++i) {
    const SE2 displacement = filter.predictedDisplacementFrom(own[i]).reference_from_current;
    const double distance = std::hypot(displacement.translation().norm() / options.older_dist_linear,
                                       displacement.yaw / options.older_dist_angular);
    if (distance < 1.0) near.emplace_back(i == 1 ? 0.0 : distance, own[i]);
  }
  std::sort(near.begin(), near.end());
  std::vector<std::size_t> clones;
  for (const auto& [distance, clone] : near) {
    if (clones.size() < static_cast<std::size_t>(options.older_compared)) clones.push_back(clone);
  }
  return clones;
}

Eigen::Matrix3d ReferenceScans::slack(std::size_t clone, const ReferenceOptions& options) const {
  const auto is_of_laser = [&](const Reference& r) { return r.laser == references_[clone].laser; };
  const auto end = references_.begin() + static_cast<std::ptrdiff_t>(clone) + 1;
  return referenceSlack(static_cast<std::size_t>(std::count_if(references_.begin(), end, is_of_laser)), options);
}

Eigen::Matrix3d referenceSlack(std::size_t references, const ReferenceOptions& options) {
  const Eigen::Vector3d std(options.older_std_translation, options.older_std_translation, options.older_std_yaw);
  return (static_cast<double>(references) * std.cwiseAbs2()).asDiagonal();
}

}  // namespace sckf
