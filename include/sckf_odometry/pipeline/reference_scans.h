// The scans that the present one can be compared with.
#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <vector>

#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/matching/prepared_scan.h"
#include "sckf_odometry/pipeline/reference_policy.h"

namespace sckf {

/// The scan of each clone of the filter, in the order of the clones: the newest first.
class ReferenceScans {
 public:
  bool empty() const { return scans_.empty(); }
  const PreparedScan& newest() const { return *scans_.front(); }
  const PreparedScan& operator[](std::size_t clone) const { return *scans_[clone]; }

  /// The scan of the clone that the filter has just made; more than `kept` are forgotten, the oldest first.
  void add(std::shared_ptr<const PreparedScan> scan, int kept, FusionMethod& filter);
  void clear() { scans_.clear(); }

  /// The clones beside the newest that a scan at the filter's pose is worth comparing with, the most telling first: the
  /// one before the newest, which sees most of what the scan sees, then the nearest, at which the robot may have been
  /// long ago.
  std::vector<std::size_t> worthComparing(const FusionMethod& filter, const ReferenceOptions& options) const;

 private:
  std::deque<std::shared_ptr<const PreparedScan>> scans_;
};

/// What the filter's covariance does not tell of a displacement from a clone, 3 × 3.
Eigen::Matrix3d referenceSlack(std::size_t clone, const ReferenceOptions& options);

}  // namespace sckf
