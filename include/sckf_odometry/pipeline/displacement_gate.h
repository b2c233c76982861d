// Who is right where a displacement contradicts the wheels.
#pragma once

#include "sckf_odometry/matching/scan_matcher.h"

namespace sckf {

/// What happens to a displacement that contradicts the wheels.
struct GateOptions {
  double probability = 0.999;         ///< χ² gate: an innovation less likely than 1 − this contradicts
  bool trust_scans_on_slip = true;    ///< where the scans match well, put the contradiction down to the wheels
  double slip_std_translation = 0.5;  ///< [m] by what, beside all their way, the wheels may be wrong then …
  double slip_std_yaw = 0.5;          ///< [rad] … and in yaw
  double slip_max_misfit = 1.3;       ///< scans match well if Match::misfit is at most this …
  double slip_min_overlap = 0.4;  ///< … and where they see two directions only, this share of the points has a partner
  double doubtful_min_agreement = 0.85;  ///< agreement that a reference needs which could not be placed itself, and an
                                         ///< older one that is found far from the prediction, or tells that wheels that
                                         ///< a match contradicts are right
};

/// A scan and a reference: where wheels predict it, and where it was found.
struct Comparison {
  const PreparedScan& reference;
  const PreparedScan& scan;
  const SE2& predicted;  ///< reference_from_current
  const Match& match;    ///< one with a displacement
};

/// Asks scans and matches only; what the filter knows, and what other references and lasers tell, is its user's.
class DisplacementGate {
 public:
  DisplacementGate(const GateOptions& options, const ScanMatcher& matcher) : options_(options), matcher_(matcher) {}

  /// A larger innovation, normalised and squared, contradicts.
  double bound(const Displacement& displacement) const;

  /// So well do scans agree that belong together without doubt.
  bool agreesWell(double agreement) const { return agreement >= options_.doubtful_min_agreement; }

  /// Whether scans may agree as they do and not belong together, as half of a crowd does that is laid on another half.
  bool isDoubtful(const Comparison& comparison) const;

  /// Whether points lie well on the whole, and where two directions are seen enough of them have a partner.
  bool matchesWell(const Match& match) const;

  /// … and are trusted more than the wheels.
  bool outweighsWheels(const Match& match) const { return options_.trust_scans_on_slip && matchesWell(match); }

  /// Whether a contradiction is put down to the wheels: the match outweighs them, or the scans refute what they tell,
  /// and then any match will do that has its place.
  bool looksLikeSlip(const Comparison& comparison) const;

  /// Whether both scans see enough that speaks for the match and against the prediction. Where a laser sees little, a
  /// short wall falls on another one somewhere, perfectly, and nothing speaks against either place. One place may fall
  /// on another one by chance; several at once do not, as the trees around: there less is asked.
  bool tellsAgainstPrediction(const Comparison& comparison) const;

 private:
  GateOptions options_;
  ScanMatcher matcher_;
};

}  // namespace sckf
