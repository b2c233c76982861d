#include "sckf_odometry/pipeline/scan_odometry.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "sckf_odometry/core/covariance.h"
#include "sckf_odometry/pipeline/chi_squared.h"

namespace sckf {

namespace {

/// So many scans beyond the time-out mean that the wheels are silent; one may have a wrong stamp.
constexpr std::size_t kConfirmations = 3;

using Clock = std::chrono::steady_clock;
double secondsSince(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

void checkMethod(const std::string& method) {
  if (makeFusionMethod(method, SE2(), Eigen::Matrix3d::Zero())) return;
  std::string known;
  for (const std::string& name : fusionMethodNames()) known += (known.empty() ? "" : ", ") + name;
  throw std::invalid_argument("method is \"" + method + "\": expected one of " + known);
}

/// What is on has to be there: other methods have no states but the pose.
void checkStates(const PipelineOptions& options) {
  const auto refuse = [&options](const std::string& parameter, const std::string& expected) {
    throw std::invalid_argument(parameter + ": expected " + expected + " with method \"" + options.method +
                                "\"; only \"sckf_multi\" has states beside the pose");
  };
  if (options.method == "sckf_multi") return;
  if (options.calibration.on) refuse("calibrate_odometry is true", "false");
  if (options.imu.gyro) refuse("use_imu is true", "false");
  if (options.imu.orientation) refuse("use_imu_orientation is true", "false");
  if (options.pose_updates.on) refuse("use_pose_updates is true", "false");
  if (options.standstill.time > 0.0) refuse("standstill_time is " + std::to_string(options.standstill.time), "0");
  if (options.landmarks.on()) refuse("landmarks is \"" + options.landmarks.use + "\"", "\"none\"");
}

void checkLasers(const PipelineOptions& options) {
  if (options.lasers == 1 || (options.lasers > 1 && options.method == "sckf_multi")) return;
  throw std::invalid_argument("there are " + std::to_string(options.lasers) + " lasers, and method is \"" +
                              options.method + "\": expected one laser, or more and method \"sckf_multi\"");
}

void checkLandmarks(const PipelineOptions& options) {
  if (!options.landmarks.only || options.landmarks.on()) return;
  throw std::invalid_argument("landmarks_only is true: expected false with landmarks \"none\"");
}

void checkPose(const SE2& odom_from_base, const Eigen::Matrix3d& covariance) {
  const std::string problem = problemOf(odom_from_base, covariance);
  if (!problem.empty()) throw std::invalid_argument(problem);
}

std::string describe(const Innovation& innovation, double bound) {
  std::ostringstream text;
  text << "normalised innovation squared " << innovation.nis() << " exceeds " << bound << " ("
       << innovation.residual.size() << " degrees of freedom)";
  return text.str();
}

}  // namespace

ScanOdometry::ScanOdometry(const PipelineOptions& options, const SE2& odom_from_base, const Eigen::Matrix3d& covariance)
    : options_(options),
      matcher_(options.matcher),
      lasers_(options.lasers, {ReferencePolicy(options.reference), {}, std::nullopt}),
      odometry_(options.motion, options.odometry_timeout),
      imu_(options.imu.timeout),
      twist_(options.twist_window),
      start_(odom_from_base),
      start_covariance_(covariance),
      landmarks_(options.landmarks) {
  checkMethod(options.method);
  checkStates(options);
  modelledIncrement(SE2(), options.odometry_noise);  // throws if there is no such model
  checkLasers(options);
  checkLandmarks(options);
  checkPose(odom_from_base, covariance);
}

OdometryBuffer::Insertion ScanOdometry::addOdometry(const OdometrySample& sample) {
  using Insertion = OdometryBuffer::Insertion;
  const Stamp newest_before = odometry_.empty() ? sample.stamp : odometry_.newest();
  const Insertion insertion = odometry_.insert(sample, guess());
  if (insertion != Insertion::kNotFinite && insertion != Insertion::kAhead) {
    wheels_heard_ = std::max(wheels_heard_.value_or(sample.stamp), sample.stamp);
  }
  if (insertion != Insertion::kInserted) return insertion;
  followWheels(newest_before);
  if (!filter_) begin(start_, start_covariance_, sample.stamp);
  carryOn();  // first: what the filter takes is forgotten
  followAtADistance();
  return insertion;
}

void ScanOdometry::addScan(LaserScan scan, const Eigen::Isometry3d& base_from_laser, std::size_t laser) {
  if (laser >= lasers_.size()) {
    throw std::out_of_range("a scan of laser " + std::to_string(laser) + ": expected one below " +
                            std::to_string(lasers_.size()));
  }
  if (!isTime(scan.stamp)) {
    std::ostringstream reason;
    reason << "its stamp is " << seconds(scan.stamp) << " s: expected a time between 1970 and 2106";
    given_up_.push_back(notUsed(scan.stamp, laser, ScanOutcome::kUnusable, reason.str()));
    return;
  }
  const Sweep sweep = options_.deskew ? lasers_[laser].sweeps.check(scan) : Sweep();
  waiting_.add(std::move(scan), base_from_laser, sweep, laser);
  while (waiting_.size() > static_cast<std::size_t>(options_.max_waiting_scans)) {
    const WaitingScans::Entry given_up = waiting_.giveUp();
    given_up_.push_back(notUsed(given_up.scan.stamp, given_up.laser, ScanOutcome::kNoOdometry,
                                "too many scans wait for odometry at their stamps"));
  }
}

std::vector<ScanReport> ScanOdometry::process() {
  std::vector<ScanReport> reports;
  reports.swap(given_up_);
  bool held_back = false;
  while (!waiting_.empty() && imuTells(waiting_.endOfOldest())) {
    const bool bracketed = filter_ && waiting_.endOfOldest() <= odometry_.newest();
    if (olderMayCome() || (!bracketed && !bridgeToOldestWaiting())) break;
    held_back = held_back || waiting_.endOfOldest() > waiting_.oldest();
    takePoses(waiting_.oldest());
    reports.push_back(take(waiting_.takeOldest()));
  }
  if (held_back) followAtADistance();
  if (filter_) takePoses(filter_stamp_);  // which come late
  return reports;
}

/// Lasers need their time for a scan, the slow ones more; their stamps are of its beginning.
bool ScanOdometry::olderMayCome() const {
  if (options_.lasers == 1 || waiting_.areOfAll(options_.lasers)) return false;
  const Stamp now = odometry_.empty() ? waiting_.newest() : std::max(waiting_.newest(), odometry_.newest());
  return now < waiting_.oldest() + toDuration(options_.scan_patience);
}

ScanReport ScanOdometry::take(const WaitingScans::Entry& waiting) {
  const Clock::time_point begin = Clock::now();
  const Stamp stamp = waiting.scan.stamp;
  if (!odometry_.covers(stamp))
    return notUsed(stamp, waiting.laser, ScanOutcome::kNoOdometry, "older than the odometry at hand");
  Laser& laser = lasers_[waiting.laser];
  if (stamp < filter_stamp_ || laser.taken == stamp) {
    return notUsed(stamp, waiting.laser, ScanOutcome::kOutOfOrder, "not newer than the estimate");
  }
  laser.taken = stamp;
  ScanReport report;
  report.laser = waiting.laser;
  report.stamp = stamp;
  report.deskewing = waiting.sweep.deskewing;
  report.deskewing_problem = waiting.sweep.problem;
  const Stamp before = filter_stamp_;
  std::optional<DisplacementPrediction> at_before;  // asked for where wheels do not tell the twist
  if (odometry_.endsBridged()) at_before = filter_->predictedDisplacement();
  propagateTo(stamp);  // (9)-(14)
  filter_->beginScan();
  useHeading(report);  // (34)
  report.wheels_known = std::exchange(wheels_known_, true);
  report.scan =
      prepareScan(waiting.scan, waiting.base_from_laser, options_.scan, &report.reason, motionDuring(waiting));
  if (report.scan) claimLandmarks(report);
  if (!report.scan) {
    report.outcome = ScanOutcome::kUnusable;
  } else if (const auto reference = references_.newestOf(waiting.laser); !reference) {
    report.new_reference = true;
  } else if (!options_.landmarks.only) {
    compareWithReference(*reference, report);  // (16)-(23)
  }
  if (report.scan) useLandmarks(report);
  if (at_before) followScans(before, *at_before, report);
  if (report.new_reference) {
    compareWithOlderReferences(report);
    filter_->clone(report.scan->rangeVariances());  // (24)-(27)
    references_.add(report.scan, report.laser, options_.reference.kept, *filter_);
    landmarks_.countReference();
  }
  report.estimate = estimate();
  report.in_map = inMap();
  report.calibration = filter_->calibration();
  report.gyro_bias = filter_->gyroBias();
  report.gyro_time = std::exchange(gyro_time_, 0.0);
  report.stands = standstill_.stands(options_.standstill);
  leaveTrail();
  carried_on_.reset();
  carryOn();
  report.total_time = secondsSince(begin);
  return report;
}

void ScanOdometry::compareWithReference(std::size_t clone, ScanReport& report) {
  const PreparedScan& reference = references_[clone];
  report.reference_stamp = reference.stamp;
  report.prediction = filter_->predictedDisplacementFrom(clone);  // (16)
  const Clock::time_point begin = Clock::now();
  report.match = matcher_.match(reference, *report.scan, report.prediction);  // (1)
  report.match_time = secondsSince(begin);
  if (report.match.displacement) report.match.displacement->clone = clone;
  const bool used = report.match.displacement ? fuse(report) : false;  // (17)-(23)
  if (!report.match.displacement) {
    report.outcome = ScanOutcome::kNoMatch;
    report.reason = toString(report.match.failure);
  }
  const SE2 reference_from_scan = filter_->predictedDisplacementFrom(clone).reference_from_current;
  report.new_reference = lasers_[report.laser].policy.replaces(reference_from_scan, report.match.overlap, used);
}

bool ScanOdometry::fuse(ScanReport& report) {
  const Displacement& displacement = *report.match.displacement;
  const double bound = gate(displacement);
  report.innovation = filter_->innovation(displacement);
  report.nis_bound = bound;
  report.outcome = ScanOutcome::kUpdated;
  const Displacement::MatrixDD slack = slackAmongLasers(displacement);
  const auto contradicts = [&] { return report.innovation->nis(slack) > bound; };
  if (contradicts() && looksLikeSlip(report.match)) {
    const Eigen::Vector3d std(options_.gate.slip_std_translation, options_.gate.slip_std_translation,
                              options_.gate.slip_std_yaw);
    filter_->distrustWheels(std.cwiseAbs2().asDiagonal());
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

void ScanOdometry::compareWithOlderReferences(ScanReport& report) {
  const ReferenceOptions& options = options_.reference;
  for (const std::size_t clone : references_.worthComparing(report.laser, *filter_, options)) {
    DisplacementPrediction prediction = filter_->predictedDisplacementFrom(clone);
    const Eigen::Matrix3d slack = references_.slack(clone, options);
    prediction.covariance += slack;
    Match match = matcher_.matchNear(references_[clone], *report.scan, prediction);
    if (!match.displacement || match.overlap < options.older_min_overlap) continue;
    Displacement& displacement = *match.displacement;
    displacement.clone = clone;
    displacement.matching_noise += (options.older_inflation - 1.0) * displacement.covariance();
    const Innovation innovation = filter_->innovation(displacement);
    if (innovation.nis(displacement.observable * slack * displacement.observable.transpose()) > gate(displacement))
      continue;
    filter_->update(displacement, innovation);
    ++report.older_references;
  }
}

/// Another laser may have corrected the estimate just now, by a displacement whose covariance has tails.
Displacement::MatrixDD ScanOdometry::slackAmongLasers(const Displacement& displacement) const {
  if (options_.lasers == 1) return Displacement::MatrixDD::Zero(displacement.dimension(), displacement.dimension());
  const Eigen::Matrix3d slack = references_.slack(displacement.clone, options_.reference);
  return displacement.observable * slack * displacement.observable.transpose();
}

LandmarkStates* ScanOdometry::landmarkFilter() const {
  return options_.landmarks.on() ? dynamic_cast<LandmarkStates*>(filter_.get()) : nullptr;
}

void ScanOdometry::claimLandmarks(ScanReport& report) {
  const LandmarkStates* filter = landmarkFilter();
  if (filter == nullptr) return;
  report.scan = landmarks_.claim(report.scan, *filter, options_.reference, options_.scan.surface);
}

void ScanOdometry::useLandmarks(ScanReport& report) {
  LandmarkStates* filter = landmarkFilter();
  if (filter == nullptr) return;
  report.landmarks_used = landmarks_.update(*filter, options_.reference);
  report.landmarks = landmarks_.views(*filter);
  if (!options_.landmarks.only || report.new_reference) return;
  report.outcome = report.landmarks_used > 0 ? ScanOutcome::kUpdated : ScanOutcome::kNoMatch;
  if (report.landmarks_used == 0) report.reason = "no landmark seen; displacements are not used";
}

double ScanOdometry::gate(const Displacement& displacement) const {
  return chiSquared(displacement.dimension(), options_.gate.probability);
}

bool ScanOdometry::looksLikeSlip(const Match& match) const {
  return options_.gate.trust_scans_on_slip && match.displacement->dimension() == 3 &&
         match.overlap >= options_.gate.slip_min_overlap && match.residual_rms <= options_.gate.slip_max_residual;
}

std::optional<Estimate> ScanOdometry::latest() const {
  if (!latest_) return std::nullopt;
  return Estimate{latest_stamp_, latest_->pose(), latest_->covariance(), twist_.twist()};
}

void ScanOdometry::setPose(const SE2& odom_from_base, const Eigen::Matrix3d& covariance, Stamp stamp) {
  checkPose(odom_from_base, covariance);
  start_ = odom_from_base;
  start_covariance_ = covariance;
  if (!filter_) return;
  propagateTo(stamp >= filter_stamp_ && odometry_.covers(stamp) ? stamp : odometry_.newest());
  begin(odom_from_base, covariance, filter_stamp_);
}

void ScanOdometry::setOptions(const PipelineOptions& options) {
  if (options.lasers != options_.lasers) {
    throw std::invalid_argument("there are " + std::to_string(options.lasers) + " lasers: expected " +
                                std::to_string(options_.lasers) + ", which only a new estimate can change");
  }
  if (options.method != options_.method) {
    throw std::invalid_argument("method is \"" + options.method + "\": expected \"" + options_.method +
                                "\", which only a new estimate can change");
  }
  modelledIncrement(SE2(), options.odometry_noise);  // throws if there is no such model
  checkStates(options);
  checkLandmarks(options);
  options_ = options;
  matcher_ = ScanMatcher(options.matcher);
  for (Laser& laser : lasers_) laser.policy.setOptions(options.reference);
  landmarks_.setOptions(options.landmarks);
  odometry_.setLimits(options.motion, options.odometry_timeout);
  twist_.setDuration(options.twist_window);
}

void ScanOdometry::begin(const SE2& odom_from_base, const Eigen::Matrix3d& covariance, Stamp stamp) {
  const StateOptions states = statesFor(options_.calibration, options_.imu);
  map_ = nullptr;
  if (options_.pose_updates.on) {
    auto odom = std::make_unique<MultiCloneFilter>(odom_from_base, symmetric(covariance), states);
    auto map = std::make_unique<MapFilter>(std::move(odom));
    map_ = map.get();
    filter_ = std::move(map);
  } else {
    filter_ = makeFusionMethod(options_.method, odom_from_base, symmetric(covariance), states);  // (6)(7)
  }
  trail_.clear();
  filter_stamp_ = stamp;
  odometry_.discardBefore(stamp);
  wheels_known_ = true;
  standstill_.interrupt();
  imu_.forgetTaken();
  references_.clear();
  for (Laser& laser : lasers_) {
    laser.policy = ReferencePolicy(options_.reference);
    laser.taken.reset();
  }
  landmarks_ = Landmarks(options_.landmarks);
  carried_on_.reset();
  carryOn();
}

/// The odometry at hand covers it, the filter is at its beginning.
ScanMotion ScanOdometry::motionDuring(const WaitingScans::Entry& waiting) const {
  ScanMotion motion;
  Standstill standstill = standstill_;
  for (const OdometryBuffer::Step& step : odometry_.steps(waiting.scan.stamp, waiting.end())) {
    motion.add(filter_->refined(increment(step, standstill)).before_from_after,
               seconds(step.to.stamp - step.from.stamp));
  }
  return motion;
}

/// Without scans the filter follows the wheels at a distance, so that the buffer stays small; from sample to sample, so
/// that it makes no difference when the samples arrived. A scan that waits for the end of its sweep holds it back.
void ScanOdometry::followAtADistance() {
  Stamp too_old = odometry_.newest() - toDuration(options_.max_scan_delay);
  const bool holds_back = !waiting_.empty() && waiting_.endOfOldest() > waiting_.oldest();
  if (holds_back) too_old = std::min(too_old, waiting_.oldest());
  if (too_old <= filter_stamp_) return;
  odometry_.discardBefore(filter_stamp_);  // for which a sample may have come just now
  const Stamp last = odometry_.lastUpTo(too_old);
  takePoses(last);
  if (last > filter_stamp_) propagateTo(last);
  if (carried_on_stamp_ < filter_stamp_) carryOn();
}

void ScanOdometry::propagateTo(Stamp stamp) {
  for (const OdometryBuffer::Step& step : odometry_.steps(filter_stamp_, stamp)) {
    const OdometryIncrement motion = increment(step, standstill_);
    const double dt = seconds(step.to.stamp - step.from.stamp);
    filter_->propagate(motion);
    filter_->age(dt);
    for (const MotionMeasurement& z : motion.measured) gyro_time_ += z.bias_time;
    if (step.guess) wheels_known_ = false;
  }
  filter_stamp_ = stamp;
  odometry_.discardBefore(stamp);
  imu_.discardBefore(stamp);
  leaveTrail();
}

void ScanOdometry::leaveTrail() {
  if (map_ != nullptr) trail_.add(filter_stamp_, filter_->pose(), options_.max_scan_delay);
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

/// Whether there is nothing to wait for: the IMU tells, or is silent.
bool ScanOdometry::imuTells(Stamp stamp) const {
  if (!options_.imu.isUsed() || imu_.empty() || stamp <= imu_.newest()) return true;
  const Stamp silent = imu_.newest() + toDuration(options_.imu.timeout);
  return (!odometry_.empty() && odometry_.newest() > silent) || waiting_.countAfter(silent) > 0;
}

/// The newest sample of odometry of which the IMU can tell no more than it has told.
Stamp ScanOdometry::settled() const {
  const Stamp newest = odometry_.newest();
  if (imuTells(newest)) return newest;
  return std::max(carried_on_stamp_, odometry_.lastUpTo(std::max(imu_.newest(), carried_on_stamp_)));
}

void ScanOdometry::carryOn() {
  if (!carried_on_ || carried_on_stamp_ < filter_stamp_) {
    carried_on_.emplace(filter_->pose(), filter_->covariance());
    carried_on_stamp_ = filter_stamp_;
    carried_on_standstill_ = standstill_;
  }
  const auto carry = [this](DeadReckoning& estimate, Standstill& standstill, Stamp from, Stamp to) {
    for (const OdometryBuffer::Step& step : odometry_.steps(from, to)) {
      estimate.propagate(filter_->refined(increment(step, standstill)));
    }
  };
  const Stamp settled = this->settled();
  carry(*carried_on_, carried_on_standstill_, carried_on_stamp_, settled);
  carried_on_stamp_ = settled;
  latest_ = carried_on_;
  Standstill standstill = carried_on_standstill_;
  latest_stamp_ = odometry_.newest();
  carry(*latest_, standstill, settled, latest_stamp_);
}

bool ScanOdometry::onScansAlone() const {
  const Stamp timeout = toDuration(options_.odometry_timeout);
  const bool alone = odometry_.endsBridged() && (!wheels_heard_ || odometry_.newest() > *wheels_heard_ + timeout);
  return alone || (!waiting_.empty() && wheelsAreSilent());
}

bool ScanOdometry::wheelsAreSilent() const {
  const Stamp timeout = toDuration(options_.odometry_timeout);
  const bool alone = odometry_.endsBridged();
  const Stamp heard = wheels_heard_.value_or(alone ? odometry_.oldest() - timeout : waiting_.oldest());
  if (alone && waiting_.oldest() > heard + timeout && waiting_.oldest() <= odometry_.newest() + timeout) return true;
  const auto most = static_cast<std::size_t>(options_.max_waiting_scans);
  return waiting_.countAfter(heard + timeout) >= std::min(kConfirmations, most);
}

bool ScanOdometry::bridgeToOldestWaiting() {
  const bool scans_tell = options_.method != "dead_reckoning";
  if (!options_.scans_alone || !scans_tell || !wheelsAreSilent()) return false;
  for (const Stamp stamp : {waiting_.oldest(), waiting_.endOfOldest()}) {
    if (odometry_.empty() || stamp > odometry_.newest()) odometry_.bridge(stamp, guess());
    if (!filter_) begin(start_, start_covariance_, stamp);
  }
  return true;
}

void ScanOdometry::followWheels(Stamp since) {
  for (const OdometryBuffer::Step& step : odometry_.steps(since, odometry_.newest())) {
    if (step.guess) continue;
    twist_.add(filter_->refined(byWheels(step)), seconds(step.to.stamp - step.from.stamp));
    motion_known_ = step.to.stamp;
  }
}

/// Without wheels the twist is that of the estimate from scan to scan. The covariance leaves aside that both ends have
/// the reference's noise in common: it is too large rather than too small.
void ScanOdometry::followScans(Stamp since, const DisplacementPrediction& at_since, const ScanReport& report) {
  const DisplacementPrediction now = filter_->predictedDisplacement();
  Eigen::Matrix3d A;
  Eigen::Matrix3d B;
  const SE2 motion = between(at_since.reference_from_current, now.reference_from_current, &A, &B);
  twist_.add({motion, symmetric(A * at_since.covariance * A.transpose() + B * now.covariance * B.transpose())},
             seconds(report.stamp - since));
  const auto& displacement = report.match.displacement;
  if (wasUsed(report.outcome) && displacement && displacement->dimension() == 3) motion_known_ = report.stamp;
}

MotionGuess ScanOdometry::guess() const { return {twist_.twist().mean, motion_known_}; }

OdometryIncrement ScanOdometry::increment(const OdometryBuffer::Step& step, Standstill& standstill) const {
  OdometryIncrement increment = byWheels(step);
  const SE2& motion = increment.before_from_after;
  const double dt = seconds(step.to.stamp - step.from.stamp);
  if (options_.imu.gyro) {
    const std::optional<double> rotation = imu_.rotation(step.from.stamp, step.to.stamp);
    if (rotation) increment.measured.push_back(gyroMeasurement(*rotation, motion.yaw, dt, options_.imu));
  }
  step.guess ? standstill.interrupt() : standstill.add(motion, dt, options_.standstill);
  if (standstill.stands(options_.standstill)) {
    increment.by_wheels = false;
    increment.measured.push_back(standstillMeasurement(dt, options_.standstill));
  }
  return increment;
}

OdometryIncrement ScanOdometry::byWheels(const OdometryBuffer::Step& step) const {
  if (step.guess) {
    OdometryIncrement guessed =
        guessedIncrement(*step.guess, step.from.stamp, step.to.stamp, options_.odometry_timeout, options_.motion);
    guessed.by_wheels = false;
    return guessed;
  }
  const SE2 motion = between(step.from.odom_from_base, step.to.odom_from_base);
  const auto& stated = step.to.twist_covariance;
  if (options_.prefer_twist_covariance && stated && sensibleTwistCovariance(*stated)) {
    return statedIncrement(motion, *stated, seconds(step.to.stamp - step.from.stamp));
  }
  return modelledIncrement(motion, options_.odometry_noise);
}

Estimate ScanOdometry::estimate() const {
  return {filter_stamp_, filter_->pose(), filter_->covariance(), twist_.twist()};
}

}  // namespace sckf
