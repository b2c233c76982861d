#include "sckf_odometry/pipeline/displacement_updates.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <sstream>

#include "sckf_odometry/core/covariance.h"
#include "sckf_odometry/pipeline/stopwatch.h"

namespace sckf {

namespace {

std::string describe(const Innovation& innovation, double bound) {
  std::ostringstream text;
  text << "normalised innovation squared " << innovation.nis() << " exceeds " << bound << " ("
       << innovation.residual.size() << " degrees of freedom)";
  return text.str();
}

std::string describeDoubt(double agreement, double expected) {
  std::ostringstream text;
  text << "the scans agree by " << agreement << " with a reference that could not be placed itself: expected "
       << expected;
  return text.str();
}

/// So far from where it is predicted that points are paired with others than they would be there.
bool isFar(const Match& match, const DisplacementPrediction& prediction) {
  constexpr double kFar = 0.3;     // [m]
  constexpr double kTurned = 0.1;  // [rad]
  const Eigen::Vector3d e = error(match.displacement->reference_from_current, prediction.reference_from_current);
  return e.head<2>().norm() > kFar || std::abs(e.z()) > kTurned;
}

/// What matches err by beyond range noise is partly the same from reference to reference, as the same surfaces are
/// taken wrong in each: it adds up faster than errors that have nothing in common. Only so much of it is in the pose as
/// the update has taken over from the displacement: nothing where the wheels know better. matching_common:
/// ReferenceOptions::matching_common.
void allowForCommonErrors(const ScanReport& report, double matching_common, FusionMethod& filter) {
  if (!wasUsed(report.outcome) || !report.match.displacement) return;
  const Displacement& z = *report.match.displacement;
  const Displacement::MatrixDD share = Displacement::MatrixDD::Identity(z.dimension(), z.dimension()) -
                                       z.covariance() * report.innovation->covariance.inverse();
  Displacement::Matrix3D taken_over = z.fromObservable() * share;
  taken_over.topRows<2>() = (z.reference_from_current.rotation().transpose() * taken_over.topRows<2>()).eval();
  filter.loosen(matching_common * symmetric(taken_over * z.matching_noise * taken_over.transpose()));
}

}  // namespace

DisplacementUpdates::DisplacementUpdates(const DisplacementOptions& options, std::size_t lasers)
    : options_(options),
      matcher_(options.matcher),
      gate_(options.gate, matcher_),
      lasers_(lasers, Laser(options.reference)) {}

void DisplacementUpdates::setOptions(const DisplacementOptions& options) {
  options_ = options;
  matcher_ = ScanMatcher(options.matcher);
  gate_ = DisplacementGate(options.gate, matcher_);
  for (Laser& laser : lasers_) laser.policy.setOptions(options.reference);
}

void DisplacementUpdates::update(ScanReport& report, FusionMethod& filter) {
  const std::size_t clone = *references_.newestOf(report.laser);
  const PreparedScan& reference = references_[clone];
  report.reference_stamp = reference.stamp;
  report.prediction = filter.predictedDisplacementFrom(clone);  // (16)
  const Stopwatch stopwatch;
  report.match = matcher_.match(reference, *report.scan, report.prediction);  // (1)
  report.match_time = stopwatch.seconds();
  bool used = false;
  if (report.match.displacement) {
    report.match.displacement->clone = clone;
    used = fuse(report, filter);  // (17)-(23)
  } else {
    report.outcome = ScanOutcome::kNoMatch;
    report.reason = toString(report.match.failure);
  }
  Laser& laser = lasers_[report.laser];
  if (used) {
    laser.place(report.stamp);
  } else {
    ++laser.failures;
  }
  const SE2 reference_from_scan = filter.predictedDisplacementFrom(clone).reference_from_current;
  report.new_reference = laser.policy.replaces(reference_from_scan, report.match.overlap, used);
}

bool DisplacementUpdates::fuse(ScanReport& report, FusionMethod& filter) {
  const Displacement& displacement = *report.match.displacement;
  const Comparison comparison{references_[displacement.clone], *report.scan, report.prediction.reference_from_current,
                              report.match};
  report.innovation = filter.innovation(displacement);
  report.nis_bound = gate_.bound(displacement);
  if (isDoubtful(report, comparison)) {
    report.outcome = ScanOutcome::kGated;
    report.reason = describeDoubt(report.match.agreement, options_.gate.doubtful_min_agreement);
    return false;
  }
  report.outcome = ScanOutcome::kUpdated;
  const auto contradicts = [&report] { return report.innovation->nis() > report.nis_bound; };
  const bool slipped = contradicts() && gate_.looksLikeSlip(comparison) && !olderConfirmWheels(report, filter);
  if (slipped) {
    allowForSlip(filter, report.prediction.reference_from_current.translation().norm());
    report.innovation = filter.innovation(displacement);
    if (report.wheels_known) report.outcome = ScanOutcome::kSlip;
  }
  if (contradicts()) {
    report.outcome = ScanOutcome::kGated;
    report.reason = describe(*report.innovation, report.nis_bound);
    return false;
  }
  filter.update(displacement, *report.innovation);
  return true;
}

/// A reference that could not be placed itself may be a crowd, of which the next scan sees half elsewhere: scans have
/// to agree better than others, or far better than anywhere near, as where a few trees are all that is seen. But where
/// they never do, as in falling snow, that is what the place looks like, and after some time they count as they are.
bool DisplacementUpdates::isDoubtful(const ScanReport& report, const Comparison& comparison) const {
  constexpr int kMany = 20;                  // scans in a row that were placed by no reference …
  constexpr std::chrono::seconds kLong(20);  // … for so long
  const Laser& laser = lasers_[report.laser];
  if (laser.failures == 0) return false;
  if (laser.failures >= kMany && (!laser.placed || report.stamp >= *laser.placed + Stamp(kLong))) return false;
  return gate_.isDoubtful(comparison);
}

void DisplacementUpdates::becomeReference(ScanReport& report, FusionMethod& filter) {
  if (report.outcome != ScanOutcome::kGated) compareWithOlder(report, filter);  // else what it says is not believed
  if (lasers_[report.laser].failures > 0) admitFailure(report, filter);
  allowForCommonErrors(report, options_.reference.matching_common, filter);
  filter.clone(report.scan->rangeVariances());  // (24)-(27)
  references_.add(report.scan, report.laser, options_.reference.kept, filter);
}

void DisplacementUpdates::compareWithOlder(ScanReport& report, FusionMethod& filter) {
  for (const std::size_t clone : references_.worthComparing(report.laser, filter, options_.reference)) {
    const std::optional<Displacement> displacement = displacementFrom(clone, report, filter);
    if (!displacement) continue;
    const Innovation innovation = filter.innovation(*displacement);
    if (innovation.nis() > gate_.bound(*displacement)) continue;
    filter.update(*displacement, innovation);
    ++report.older_references;
    lasers_[report.laser].place(report.stamp);
  }
}

/// From an older reference; empty if there is none that is believed. One that is the first to place the scan decides
/// alone, as on a slip.
std::optional<Displacement> DisplacementUpdates::displacementFrom(std::size_t clone, const ScanReport& report,
                                                                  const FusionMethod& filter) const {
  const bool placed = lasers_[report.laser].failures == 0;
  const DisplacementPrediction prediction = filter.predictedDisplacementFrom(clone);
  Match match = matchWithOlder(references_[clone], *report.scan, prediction, placed);
  if (!match.displacement || match.overlap < options_.reference.older_min_overlap) return std::nullopt;
  match.displacement->clone = clone;
  if (!placed && !gate_.outweighsWheels(match)) return std::nullopt;
  const Comparison comparison{references_[clone], *report.scan, prediction.reference_from_current, match};
  if (isFar(match, prediction) && !gate_.tellsAgainstPrediction(comparison)) return std::nullopt;
  Displacement& displacement = *match.displacement;
  displacement.matching_noise += (options_.reference.older_inflation - 1.0) * displacement.covariance();
  return std::move(match.displacement);
}

/// Near the prediction; or, where that may be far off and the scan is none that fits nowhere, wherever the scans fall
/// together without doubt.
Match DisplacementUpdates::matchWithOlder(const PreparedScan& reference, const PreparedScan& scan,
                                          const DisplacementPrediction& prediction, bool placed) const {
  if (placed && isVague(prediction)) {
    Match match = matcher_.match(reference, scan, prediction);
    if (match.displacement && gate_.agreesWell(match.agreement) && gate_.matchesWell(match)) return match;
  }
  return matcher_.matchNear(reference, scan, prediction);
}

/// Scan or wheels are wrong, and unless another laser tells nobody knows which: the estimate may be off by a slip. So
/// it is at the scans after it until one is placed again, and a reference that could not be placed, nor any scan from
/// it, is of no use.
void DisplacementUpdates::admitFailure(const ScanReport& report, FusionMethod& filter) {
  if (lasers_[report.laser].failures > 1) {
    references_.forgetNewestOf(report.laser, filter);
  } else if (options_.gate.trust_scans_on_slip && !othersTell(report.stamp)) {
    allowForSlip(filter, 0.0);
  }
}

/// Whether scans of another laser have been placed lately, and none has failed since.
bool DisplacementUpdates::othersTell(Stamp stamp) const {
  const Stamp lately = stamp - Stamp(std::chrono::seconds(1));
  return std::any_of(lasers_.begin(), lasers_.end(), [lately](const Laser& laser) {
    return laser.failures == 0 && laser.placed && *laser.placed > lately;
  });
}

/// way: [m] what they tell that is certainly not true.
void DisplacementUpdates::allowForSlip(FusionMethod& filter, double way) const {
  const double std_translation = std::hypot(options_.gate.slip_std_translation, way);
  const Eigen::Vector3d std(std_translation, std_translation, options_.gate.slip_std_yaw);
  filter.distrustWheels(std.cwiseAbs2().asDiagonal());
}

/// Whether older references of whose place nobody doubts, and on which the scan lies well where the wheels tell, fit
/// better there than at the match with the newest. A stair lies on the next one of a stairway, a column on the next
/// one, but not from everywhere alike.
bool DisplacementUpdates::olderConfirmWheels(const ScanReport& report, const FusionMethod& filter) const {
  const SE2 predicted_from_matched =
      between(report.prediction.reference_from_current, report.match.displacement->reference_from_current);
  double for_the_match = 0.0;  // loss, as in tellsAgainstPrediction()
  for (const std::size_t clone : references_.worthComparing(report.laser, filter, options_.reference)) {
    const DisplacementPrediction prediction = filter.predictedDisplacementFrom(clone);
    if (isVague(prediction)) continue;
    const SE2& predicted = prediction.reference_from_current;
    const Fit there = matcher_.fit(references_[clone], *report.scan, predicted);
    if (there.overlap < options_.reference.older_min_overlap) continue;
    if (!gate_.agreesWell(there.agreement)) continue;
    const SE2 matched = compose(predicted, predicted_from_matched);
    for_the_match += there.loss - matcher_.fit(references_[clone], *report.scan, matched).loss;
  }
  return for_the_match < 0.0;
}

}  // namespace sckf
