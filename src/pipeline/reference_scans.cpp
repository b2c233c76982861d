#include "sckf_odometry/pipeline/reference_scans.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sckf {

void ReferenceScans::add(std::shared_ptr<const PreparedScan> scan, int kept, FusionMethod& filter) {
  while (filter.clones() > static_cast<std::size_t>(kept)) filter.forget(filter.clones() - 1);
  scans_.push_front(std::move(scan));
  scans_.resize(filter.clones());
}

std::vector<std::size_t> ReferenceScans::worthComparing(const FusionMethod& filter,
                                                        const ReferenceOptions& options) const {
  std::vector<std::pair<double, std::size_t>> near;  // distance as a share of what is allowed
  for (std::size_t clone = 1; clone < scans_.size(); ++clone) {
    const SE2 displacement = filter.predictedDisplacementFrom(clone).reference_from_current;
    const double distance = std::hypot(displacement.translation().norm() / options.older_dist_linear,
                                       displacement.yaw / options.older_dist_angular);
    if (distance < 1.0) near.emplace_back(clone == 1 ? 0.0 : distance, clone);
  }
  std::sort(near.begin(), near.end());
  std::vector<std::size_t> clones;
  for (const auto& [distance, clone] : near) {
    if (clones.size() < static_cast<std::size_t>(options.older_compared)) clones.push_back(clone);
  }
  return clones;
}

Eigen::Matrix3d referenceSlack(std::size_t clone, const ReferenceOptions& options) {
  const double references = static_cast<double>(clone + 1);
  return references *
         Eigen::Vector3d(options.older_std_translation, options.older_std_translation, options.older_std_yaw)
             .cwiseAbs2()
             .asDiagonal()
             .toDenseMatrix();
}

}  // namespace sckf
