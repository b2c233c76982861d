// How a scan corrects the estimate: by displacements from references, by landmarks, by a heading.
#include <Eigen/LU>
#include <algorithm>
#include <sstream>

#include "sckf_odometry/core/covariance.h"
#include "sckf_odometry/pipeline/chi_squared.h"
#include "sckf_odometry/pipeline/scan_odometry.h"
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

}  // namespace

void ScanOdometry::compareWithReference(std::size_t clone, ScanReport& report) {
  const PreparedScan& reference = references_[clone];
  report.reference_stamp = reference.stamp;
  report.prediction = filter_->predictedDisplacementFrom(clone);  // (16)
  const Stopwatch stopwatch;
  report.match = matcher_.match(reference, *report.scan, report.prediction);  // (1)
  report.match_time = stopwatch.seconds();
  bool used = false;
  if (report.match.displacement) {
    report.match.displacement->clone = clone;
    used = fuse(report);  // (17)-(23)
  } else {
    report.outcome = ScanOutcome::kNoMatch;
    report.reason = toString(report.match.failure);
  }
  Laser& laser = lasers_[report.laser];
  laser.failures = used ? 0 : laser.failures + 1;
  if (used) {
    laser.constants.range_offset.add(report.match.range_offset, report.scan->range_offset);
    laser.constants.sweep_duration.add(report.match.sweep_duration, report.scan->sweep.duration);
  }
  const SE2 reference_from_scan = filter_->predictedDisplacementFrom(clone).reference_from_current;
  report.new_reference = laser.policy.replaces(reference_from_scan, report.match.overlap, used);
}

bool ScanOdometry::fuse(ScanReport& report) {
  const Displacement& displacement = *report.match.displacement;
  const double bound = gate(displacement);
  report.innovation = filter_->innovation(displacement);
  report.nis_bound = bound;
  if (lasers_[report.laser].failures > 0 && report.match.agreement < options_.gate.doubtful_min_agreement) {
    report.outcome = ScanOutcome::kGated;
    report.reason = describeDoubt(report.match.agreement, options_.gate.doubtful_min_agreement);
    return false;
  }
  report.outcome = ScanOutcome::kUpdated;
  const auto contradicts = [&] { return report.innovation->nis() > bound; };
  const bool slipped = contradicts() && looksLikeSlip(report);
  if (slipped) {
    allowForSlip();
    report.innovation = filter_->innovation(displacement);
    if (report.wheels_known) report.outcome = ScanOutcome::kSlip;
  }
  if (contradicts()) {
    report.outcome = ScanOutcome::kGated;
    report.reason = describe(*report.innovation, bound);
    return false;
  }
  filter_->update(displacement, *report.innovation);
  return true;
}

/// Scan or wheels are wrong, and unless another laser tells nobody knows which: the estimate may be off by a slip. So
/// it is at the scans after it until one is placed again, and a reference that could not be placed, nor any scan from
/// it, is of no use.
void ScanOdometry::admitFailure(const ScanReport& report) {
  if (lasers_[report.laser].failures > 1) {
    references_.forgetNewestOf(report.laser, *filter_);
    return;
  }
  const Stamp lately = report.stamp - toDuration(options_.odometry_timeout);
  const bool others_tell = std::any_of(lasers_.begin(), lasers_.end(), [lately](const Laser& laser) {
    return laser.failures == 0 && laser.taken && *laser.taken > lately;
  });
  if (!others_tell && options_.gate.trust_scans_on_slip) allowForSlip();
}

void ScanOdometry::allowForSlip() {
  const Eigen::Vector3d std(options_.gate.slip_std_translation, options_.gate.slip_std_translation,
                            options_.gate.slip_std_yaw);
  filter_->distrustWheels(std.cwiseAbs2().asDiagonal());
}

void ScanOdometry::compareWithOlderReferences(ScanReport& report) {
  if (report.outcome == ScanOutcome::kGated) return;  // what it says is not believed
  const ReferenceOptions& options = options_.reference;
  Laser& laser = lasers_[report.laser];
  for (const std::size_t clone : references_.worthComparing(report.laser, *filter_, options)) {
    const DisplacementPrediction prediction = filter_->predictedDisplacementFrom(clone);
    const bool placed = laser.failures == 0;
    Match match = matchWithOlder(references_[clone], *report.scan, prediction, placed);
    if (!match.displacement || match.overlap < options.older_min_overlap) continue;
    if (!placed && !outweighsWheels(match)) continue;
    Displacement& displacement = *match.displacement;
    displacement.clone = clone;
    displacement.matching_noise += (options.older_inflation - 1.0) * displacement.covariance();
    const Innovation innovation = filter_->innovation(displacement);
    if (innovation.nis() > gate(displacement)) continue;
    filter_->update(displacement, innovation);
    ++report.older_references;
    laser.failures = 0;
  }
}

/// Near the prediction; or, where that may be far off and the scan is none that fits nowhere, wherever the scans fall
/// together without doubt.
Match ScanOdometry::matchWithOlder(const PreparedScan& reference, const PreparedScan& scan,
                                   const DisplacementPrediction& prediction, bool placed) const {
  if (placed && isVague(prediction)) {
    Match match = matcher_.match(reference, scan, prediction);
    const bool agrees = match.agreement >= options_.gate.doubtful_min_agreement;
    if (match.displacement && agrees && matchesWell(match)) return match;
  }
  return matcher_.matchNear(reference, scan, prediction);
}

/// What matches err by beyond range noise is partly the same from reference to reference, as the same surfaces are
/// taken wrong in each: it adds up faster than errors that have nothing in common. Only so much of it is in the pose as
/// the update has taken over from the displacement: nothing where the wheels know better.
void ScanOdometry::allowForCommonErrors(const ScanReport& report) {
  if (!wasUsed(report.outcome) || !report.match.displacement) return;
  const Displacement& z = *report.match.displacement;
  const Displacement::MatrixDD share = Displacement::MatrixDD::Identity(z.dimension(), z.dimension()) -
                                       z.covariance() * report.innovation->covariance.inverse();
  Displacement::Matrix3D taken_over = z.fromObservable() * share;
  taken_over.topRows<2>() = (z.reference_from_current.rotation().transpose() * taken_over.topRows<2>()).eval();
  filter_->loosen(options_.reference.matching_common *
                  symmetric(taken_over * z.matching_noise * taken_over.transpose()));
}

LandmarkStates* ScanOdometry::landmarkFilter() const {
  return options_.landmarks.on() ? dynamic_cast<LandmarkStates*>(filter_.get()) : nullptr;
}

void ScanOdometry::claimLandmarks(ScanReport& report) {
  const LandmarkStates* filter = landmarkFilter();
  if (filter == nullptr) return;
  report.scan = landmarks_.claim(report.scan, *filter, options_.scan.surface);
}

void ScanOdometry::useLandmarks(ScanReport& report) {
  LandmarkStates* filter = landmarkFilter();
  if (filter == nullptr) return;
  report.landmarks_used = landmarks_.update(*filter);
  report.landmarks = landmarks_.views(*filter);
  if (!options_.landmarks.only || report.new_reference) return;
  report.outcome = report.landmarks_used > 0 ? ScanOutcome::kUpdated : ScanOutcome::kNoMatch;
  if (report.landmarks_used == 0) report.reason = "no landmark seen; displacements are not used";
}

double ScanOdometry::gate(const Displacement& displacement) const {
  return chiSquared(displacement.dimension(), options_.gate.probability);
}

/// Where the scans refute what the wheels tell these are wrong, and any match will do that has its place.
bool ScanOdometry::looksLikeSlip(const ScanReport& report) const {
  const Match& match = report.match;
  if (outweighsWheels(match)) return true;
  return options_.gate.trust_scans_on_slip && isPlaced(match) &&
         matcher_.refutes(references_[match.displacement->clone], *report.scan,
                          report.prediction.reference_from_current);
}

bool ScanOdometry::outweighsWheels(const Match& match) const {
  return options_.gate.trust_scans_on_slip && matchesWell(match);
}

bool ScanOdometry::matchesWell(const Match& match) const {
  return isPlaced(match) && match.misfit <= options_.gate.slip_max_misfit;
}

/// One wall lies on any other, however the robot is turned.
bool ScanOdometry::isPlaced(const Match& match) const {
  const Eigen::Index seen = match.displacement->dimension();
  return seen == 3 || (seen == 2 && match.overlap >= options_.gate.slip_min_overlap);
}

void ScanOdometry::useHeading(ScanReport& report) {
  if (!options_.imu.orientation) return;
  const std::optional<double> yaw = imu_.takeYaw(report.stamp);
  if (!yaw) return;
  const double std = options_.imu.orientation_std;
  const double bound = chiSquared(1, options_.gate.probability);
  const bool contradicts = filter_->updateHeading(*yaw, std * std, bound) > bound;
  report.heading = contradicts ? HeadingUse::kContradicts : HeadingUse::kUsed;
}

}  // namespace sckf
