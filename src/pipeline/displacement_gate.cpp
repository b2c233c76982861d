#include "sckf_odometry/pipeline/displacement_gate.h"

#include "sckf_odometry/pipeline/chi_squared.h"

namespace sckf {

namespace {

/// One wall lies on any other, however the robot is turned: where two directions are seen, this share of the points has
/// to have a partner.
bool isPlaced(const Match& match, double min_overlap) {
  const Eigen::Index seen = match.displacement->dimension();
  return seen == 3 || (seen == 2 && match.overlap >= min_overlap);
}

}  // namespace

double DisplacementGate::bound(const Displacement& displacement) const {
  return chiSquared(displacement.dimension(), options_.probability);
}

bool DisplacementGate::isDoubtful(const Comparison& comparison) const {
  const auto& [reference, scan, predicted, match] = comparison;
  if (agreesWell(match.agreement)) return false;
  return !matcher_.standsOut(reference, scan, match.displacement->reference_from_current);
}

bool DisplacementGate::matchesWell(const Match& match) const {
  return isPlaced(match, options_.slip_min_overlap) && match.misfit <= options_.slip_max_misfit;
}

bool DisplacementGate::looksLikeSlip(const Comparison& comparison) const {
  const auto& [reference, scan, predicted, match] = comparison;
  if (!options_.trust_scans_on_slip || !isPlaced(match, options_.slip_min_overlap)) return false;
  const bool believed = match.misfit <= options_.slip_max_misfit || matcher_.refutes(reference, scan, predicted);
  return believed && tellsAgainstPrediction(comparison);
}

bool DisplacementGate::tellsAgainstPrediction(const Comparison& comparison) const {
  // Loss, of which four neighbouring points tell as much as one: e^12 to 1 against the prediction, as a slip is one of
  // hundreds of scans, and a search looks at thousands of places. That several things fall on each other tells most of
  // it by itself: what else is seen has only not to tell for the wheels.
  constexpr double kClearly = 50.0;
  constexpr double kClearlyOfSeveral = 5.0;
  constexpr double kSeveral = 0.65;   // DecisivePlace::share(): more places than one decide if that one has less
  constexpr double kPerfectly = 0.5;  // misfit
  const auto& [reference, scan, predicted, match] = comparison;
  const bool several = match.displacement->dimension() == 3 && match.decisive.share() < kSeveral &&
                       agreesWell(match.agreement) && match.misfit <= kPerfectly;
  const double for_the_match = matcher_.fit(reference, scan, predicted).loss -
                               matcher_.fit(reference, scan, match.displacement->reference_from_current).loss;
  return for_the_match >= (several ? kClearlyOfSeveral : kClearly);
}

}  // namespace sckf
