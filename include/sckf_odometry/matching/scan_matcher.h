// Two scans in, the displacement between them out: with its Jacobians by every range, its noise, and the directions
// that the scans see. Or the reason why there is none.
#pragma once

#include <optional>
#include <string>

#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/matching/displacement_estimation.h"
#include "sckf_odometry/matching/displacement_search.h"
#include "sckf_odometry/matching/prepared_scan.h"

namespace sckf {

/// How the displacement is searched for, and what is made of it.
struct MatcherOptions : SearchOptions {
  bool both_ways = true;               ///< match the reference with the current scan, too, and take the mean
  double min_overlap = 0.1;            ///< a smaller share of the points with a partner is "no overlap"
  double min_agreement = 0.6;          ///< less agreement of the scans is a contradiction, and no match
  double moved_place_min_share = 0.5;  ///< DecisivePlace::share() from which on a place that contradicts the prediction
                                       ///< is left out if what is left does not; 0: never
  double max_refinement = 0.5;  ///< [m, rad] a larger correction of the aligned pose by the estimate is "diverged"
  EstimationOptions estimation;
};

enum class MatchFailure {
  kNone,
  kTooFewPairs,    ///< hardly any point of one scan has a partner in the other
  kNoOverlap,      ///< too small a share of the points has a partner
  kContradiction,  ///< too many points of one scan are where the other has seen that nothing is
  kDiverged,       ///< the estimate ran away from the aligned pose
  kNotObservable,  ///< the scans see no direction of the displacement
};

/// "too few pairs", "no overlap", …: for messages and tables.
std::string toString(MatchFailure failure);

struct Match {
  std::optional<Displacement> displacement;  ///< empty if and only if failure is not kNone
  MatchFailure failure = MatchFailure::kNone;
  std::vector<Pair> pairs;          ///< at the aligned pose
  double overlap = 0.0;             ///< share of the points of the current scan that have a partner, 0 to 1
  double agreement = 0.0;           ///< AlignmentProblem::agreement(), 0 to 1
  double misfit = 0.0;              ///< AlignmentProblem::misfit(), 0 to 3
  DecisivePlace decisive;           ///< the place that decides most of the displacement
  bool place_left_out = false;      ///< another place decided more, and seems to have moved
  ConstantEvidence range_offset;    ///< DisplacementEstimate::range_offset
  ConstantEvidence sweep_duration;  ///< DisplacementEstimate::sweep_duration
};

/// Of two scans that lie somewhere: what AlignmentProblem has by these names.
struct Fit {
  double overlap = 0.0;    ///< share of the points of the current scan that have a partner, 0 to 1
  double agreement = 0.0;  ///< 0 to 1
  int contradictions = 0;  ///< points that are where the other scan has seen that nothing is
  double loss = 0.0;       ///< of all points that both scans see: what does not fit
};

class ScanMatcher {
 public:
  explicit ScanMatcher(const MatcherOptions& options) : options_(options) {}

  /// The displacement of base_link from the reference scan to the current one. The prediction guides the search and
  /// the pairing of points; into the displacement itself it enters only in directions that the scans do not see; and it
  /// decides whether a place on which a direction hangs has moved.
  Match match(const PreparedScan& reference, const PreparedScan& current,
              const DisplacementPrediction& prediction) const;

  /// The same where the prediction is good to a few centimetres: the alignment begins there, and nowhere else.
  Match matchNear(const PreparedScan& reference, const PreparedScan& current,
                  const DisplacementPrediction& prediction) const;

  /// How the scans fall together if they lie so.
  Fit fit(const PreparedScan& reference, const PreparedScan& current, const SE2& reference_from_current) const;

  /// Whether the scans cannot lie so: hardly a point has a partner, and many are where the other scan has seen that
  /// nothing is. Not if they just see nothing in common.
  bool refutes(const PreparedScan& reference, const PreparedScan& current, const SE2& reference_from_current) const;

  /// Whether the scans fall together there far better than a little aside, or turned. Scans of a crowd, and of anything
  /// dense, fall together in part wherever they are laid.
  bool standsOut(const PreparedScan& reference, const PreparedScan& current, const SE2& reference_from_current) const;

 private:
  MatcherOptions options_;
};

}  // namespace sckf
