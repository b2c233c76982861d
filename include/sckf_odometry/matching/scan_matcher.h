// Two scans in, the displacement between them out: with its Jacobians by every range, its noise, and the directions
// that the scans see. Or the reason why there is none.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/matching/prepared_scan.h"

namespace sckf {

struct MatcherOptions {
  bool use_icp = false;
  int max_iterations = 30;
  double prior_floor_translation = 0.05;
  double prior_floor_yaw = 0.05;
  double pair_distance_start = 0.5;
  double pair_distance = 0.15;
  int min_pairs = 20;
  double min_overlap = 0.2;
  double min_normal_cosine = 0.5;
  double surface_roughness = 0.01;
  double huber = 2.0;
  double max_std = 0.2;
  double min_information_ratio = 5.0;
  double max_refinement = 0.5;
  double matching_noise_scale = 1.0;
};

enum class MatchFailure {
  kNone,
  kTooFewPairs,    ///< hardly any point of one scan has a partner in the other
  kNoOverlap,      ///< too small a share of the points has a partner
  kDiverged,       ///< the solution left the region that the prediction allows, or did not settle
  kNotObservable,  ///< the scans see no direction of the displacement
};

/// "too few pairs", "no overlap", …: for messages and tables.
std::string toString(MatchFailure failure);

/// A point of the current scan and the point of the reference scan whose surface it lies on.
struct Pair {
  int reference = 0;
  int current = 0;
};

struct Match {
  std::optional<Displacement> displacement;  ///< empty if and only if failure is not kNone
  MatchFailure failure = MatchFailure::kNone;
  std::vector<Pair> pairs;    ///< at the solution
  double overlap = 0.0;       ///< share of the points of the current scan that have a partner, 0 to 1
  double residual_rms = 0.0;  ///< of the weighted residuals: 1 where noise explains them
};

class ScanMatcher {
 public:
  explicit ScanMatcher(const MatcherOptions& options);

  /// The displacement of base_link from the reference scan to the current one. The prediction guides the search and
  /// decides which points belong together; it does not enter the displacement itself where the scans see.
  Match match(const PreparedScan& reference, const PreparedScan& current,
              const DisplacementPrediction& prediction) const;

 private:
  MatcherOptions options_;
};

}  // namespace sckf
