// The scans that the present one can be compared with.
#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/matching/prepared_scan.h"
#include "sckf_odometry/pipeline/reference_policy.h"

namespace sckf {

/// The scan of each clone of the filter, in the order of the clones: the newest first. Scans are compared with those of
/// the same laser; lasers have numbers.
class ReferenceScans {
 public:
  bool empty() const { return references_.empty(); }
  const PreparedScan& operator[](std::size_t clone) const { return *references_[clone].scan; }

  /// The clone of the newest reference of a laser; empty if it has none.
  std::optional<std::size_t> newestOf(std::size_t laser) const;

  /// The scan of the clone that the filter has just made; more than `kept` of a laser are forgotten, the oldest first.
  void add(std::shared_ptr<const PreparedScan> scan, std::size_t laser, int kept, FusionMethod& filter);
  /// The laser has one.
  void forgetNewestOf(std::size_t laser, FusionMethod& filter) { forget(*newestOf(laser), filter); }
  void clear() { references_.clear(); }

  /// The clones beside the newest that a scan of that laser at the filter's pose is worth comparing with, the most
  /// telling first: the one before the newest, which sees most of what the scan sees, then the nearest, at which the
  /// robot may have been long ago.
  std::vector<std::size_t> worthComparing(std::size_t laser, const FusionMethod& filter,
                                          const ReferenceOptions& options) const;

 private:
  struct Reference {
    std::shared_ptr<const PreparedScan> scan;
    std::size_t laser;
  };

  std::vector<std::size_t> clonesOf(std::size_t laser) const;
  void forget(std::size_t clone, FusionMethod& filter);

  std::deque<Reference> references_;
};

/// Whether a displacement may be far off from what is predicted: where scans have to be searched for, and not only
/// refined.
bool isVague(const DisplacementPrediction& prediction);

}  // namespace sckf
