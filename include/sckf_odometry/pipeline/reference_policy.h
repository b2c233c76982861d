// When a scan becomes the new reference.
#pragma once

#include "sckf_odometry/core/se2.h"

namespace sckf {

/// Drift grows per reference and not per scan, so a reference is kept as long as scans can be compared with it well:
/// while the next scan, as far away from this one as this one from the last, will probably be within the limits. A scan
/// that cannot be compared with it becomes the reference at once: if the robot is not where the wheels say, the next
/// scan is nearer to this one.
/// Zero distances make every scan a reference, which is the algorithm of the paper.
struct ReferenceOptions {
  double kf_dist_linear = 0.7;   ///< [m] largest way from the reference to a scan that is compared with it
  double kf_dist_angular = 0.5;  ///< [rad] largest rotation
  double kf_min_overlap = 0.7;   ///< a scan of which fewer points have a partner than this times the most that had one
                                 ///< since the reference is kept becomes the new one

  // A scan that becomes a reference is compared with older ones too, where the method keeps more than one.
  int kept = 16;                    ///< references, the newest among them
  int older_compared = 3;           ///< so many older ones: the one before the newest, then the nearest …
  double older_dist_linear = 3.0;   ///< [m] … not farther away than this …
  double older_dist_angular = 1.5;  ///< [rad] … nor turned more …
  double older_min_overlap = 0.3;   ///< … nor with a smaller share of points with a partner
  double older_inflation = 8.0;     ///< of a displacement's covariance: it errs in part as the others of its scan
  double matching_common = 1.5;     ///< of a displacement's matching noise: so much more the next ones have in common
};

class ReferencePolicy {
 public:
  explicit ReferencePolicy(const ReferenceOptions& options) : options_(options) {}

  /// From the next scan on.
  void setOptions(const ReferenceOptions& options) { options_ = options; }

  /// Whether a scan becomes the reference. reference_from_scan: its pose as estimated now. overlap: of its match. used:
  /// whether its displacement corrected the estimate.
  bool replaces(const SE2& reference_from_scan, double overlap, bool used);

 private:
  ReferenceOptions options_;
  SE2 last_;                   // reference_from_scan of the scan before
  double most_overlap_ = 0.0;  // of a scan with the reference
};

}  // namespace sckf
