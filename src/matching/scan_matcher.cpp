#include "sckf_odometry/matching/scan_matcher.h"

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <utility>

namespace sckf {

namespace {

DisplacementSearch searchFor(const DisplacementPrediction& prediction, const PreparedScan& reference,
                             const PreparedScan& current, const MatcherOptions& options) {
  return {reference, current, prediction, options, options.estimation.observability};
}

bool ranAway(const SE2& estimated, const SE2& aligned, const MatcherOptions& options) {
  const Eigen::Vector3d moved = error(estimated, aligned);
  return !moved.allFinite() || moved.cwiseAbs().maxCoeff() > options.max_refinement;
}

/// The match that an alignment comes to, or why it comes to none.
Match concluded(const std::optional<Alignment>& aligned, const MatcherOptions& options) {
  Match match;
  if (!aligned) {
    match.failure = MatchFailure::kTooFewPairs;
    return match;
  }
  const SE2& start = aligned->reference_from_current;
  std::optional<DisplacementEstimate> estimate = estimateDisplacement(aligned->problem, start, options.estimation);
  match.pairs = aligned->problem.pairs();
  match.overlap = aligned->problem.overlap();
  match.agreement = aligned->problem.agreement();
  match.misfit = aligned->misfit();
  if (estimate) {
    match.decisive = std::move(estimate->decisive);
    match.range_offset = estimate->range_offset;
    match.sweep_duration = estimate->sweep_duration;
  }
  if (match.overlap < options.min_overlap) {
    match.failure = MatchFailure::kNoOverlap;
  } else if (match.agreement < options.min_agreement) {
    match.failure = MatchFailure::kContradiction;
  } else if (!estimate) {
    match.failure = MatchFailure::kNotObservable;
  } else if (ranAway(estimate->displacement.reference_from_current, start, options)) {
    match.failure = MatchFailure::kDiverged;
  } else {
    match.displacement.emplace(std::move(estimate->displacement));
  }
  return match;
}

/// The squared Mahalanobis distance of a match from its prediction. What its decisive place may be off by does not
/// count: whether it is off is what is asked.
double contradiction(const Match& match, const DisplacementPrediction& prediction, const EstimationOptions& options) {
  const Displacement& z = *match.displacement;
  const Displacement::MatrixDD covariance = z.observable * prediction.covariance * z.observable.transpose() +
                                            z.covariance() - placeNoise(z, match.decisive, options.place_std);
  const Eigen::VectorXd e = z.observable * error(z.reference_from_current, prediction.reference_from_current);
  return e.dot(covariance.ldlt().solve(e));
}

/// The match without the place that decides most of it, if that place contradicts the prediction and nothing else does:
/// rather than the wheels have slipped, somebody walks there. Where they have, what else is seen contradicts them, too.
std::optional<Match> withoutMovedPlace(const Match& match, const DisplacementSearch& search,
                                       const DisplacementPrediction& prediction, const MatcherOptions& options) {
  constexpr double kContradicts = 4.0;  // two sigma: not much is lost where the place is left out for nothing
  const double min_share = options.moved_place_min_share;
  if (min_share <= 0.0 || !match.displacement || match.decisive.share() < min_share) return std::nullopt;
  if (contradiction(match, prediction, options.estimation) <= kContradicts) return std::nullopt;
  Match others = concluded(search.runNearWithout(match.decisive), options);
  if (!others.displacement || contradiction(others, prediction, options.estimation) > kContradicts) return std::nullopt;
  others.place_left_out = true;
  return others;
}

/// The match refined by one of the scans with their roles exchanged, paired where they lie by now, if there is one
/// close to it.
Match refinedByReturn(Match match, const PreparedScan& reference, const PreparedScan& current,
                      const MatcherOptions& options) {
  constexpr double kFarthest = 0.1;  // [m]
  constexpr double kTurned = 0.05;   // [rad]
  if (!options.both_ways || !match.displacement || match.displacement->dimension() != 3) return match;
  const SE2& there = match.displacement->reference_from_current;
  const Match back = concluded(searchFor({inverse(there)}, current, reference, options).there(), options);
  if (!back.displacement || back.displacement->dimension() != 3) return match;
  const Eigen::Vector3d e = error(inverse(back.displacement->reference_from_current), there);
  if (e.head<2>().norm() > kFarthest || std::abs(e.z()) > kTurned) return match;
  match.displacement = meanOfBothWays(*match.displacement, *back.displacement);
  return match;
}

}  // namespace

std::string toString(MatchFailure failure) {
  switch (failure) {
    case MatchFailure::kNone:
      return "none";
    case MatchFailure::kTooFewPairs:
      return "too few pairs";
    case MatchFailure::kNoOverlap:
      return "no overlap";
    case MatchFailure::kContradiction:
      return "scans contradict each other";
    case MatchFailure::kDiverged:
      return "diverged";
    case MatchFailure::kNotObservable:
      return "not observable";
  }
  return "unknown";
}

Match ScanMatcher::match(const PreparedScan& reference, const PreparedScan& current,
                         const DisplacementPrediction& prediction) const {
  const DisplacementSearch search = searchFor(prediction, reference, current, options_);
  Match match = concluded(search.run(), options_);
  if (std::optional<Match> others = withoutMovedPlace(match, search, prediction, options_)) return *std::move(others);
  return refinedByReturn(std::move(match), reference, current, options_);
}

Match ScanMatcher::matchNear(const PreparedScan& reference, const PreparedScan& current,
                             const DisplacementPrediction& prediction) const {
  const std::optional<Alignment> aligned = searchFor(prediction, reference, current, options_).runNear();
  return refinedByReturn(concluded(aligned, options_), reference, current, options_);
}

Fit ScanMatcher::fit(const PreparedScan& reference, const PreparedScan& current,
                     const SE2& reference_from_current) const {
  const AlignmentProblem there(reference, current, reference_from_current, options_.pairs.max_distance, options_.pairs);
  return {there.overlap(), there.agreement(), there.contradictions(), there.loss(reference_from_current)};
}

bool ScanMatcher::refutes(const PreparedScan& reference, const PreparedScan& current,
                          const SE2& reference_from_current) const {
  constexpr double kHardlyAny = 0.1;  // agreement
  constexpr double kMany = 0.25;      // of the points of one scan
  const Fit there = fit(reference, current, reference_from_current);
  return there.agreement < kHardlyAny && there.contradictions > kMany * static_cast<double>(current.size());
}

bool ScanMatcher::standsOut(const PreparedScan& reference, const PreparedScan& current,
                            const SE2& reference_from_current) const {
  constexpr double kFarBetter = 0.4;  // of the loss elsewhere: trees have 0.4 at most, crowds 0.5 and more
  constexpr double kAside = 0.7;      // [m], farther than points are paired
  constexpr double kTurned = 0.25;    // [rad]
  const std::array<Eigen::Vector3d, 4> steps = {Eigen::Vector3d(kAside, 0.0, 0.0), Eigen::Vector3d(0.0, kAside, 0.0),
                                                Eigen::Vector3d(0.0, 0.0, kTurned),
                                                Eigen::Vector3d(0.0, 0.0, 2.0 * kTurned)};
  const auto loss = [&](const SE2& at) { return fit(reference, current, at).loss; };
  double elsewhere = 0.0;
  for (const Eigen::Vector3d& step : steps) {
    elsewhere += loss(corrected(reference_from_current, step)) + loss(corrected(reference_from_current, -step));
  }
  return loss(reference_from_current) < kFarBetter * elsewhere / (2.0 * static_cast<double>(steps.size()));
}

}  // namespace sckf
