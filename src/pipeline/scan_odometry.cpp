#include "sckf_odometry/pipeline/scan_odometry.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "sckf_odometry/core/covariance.h"
#include "sckf_odometry/pipeline/chi_squared.h"
#include "sckf_odometry/pipeline/stopwatch.h"

namespace sckf {

namespace {

void checkPose(const SE2& odom_from_base, const Eigen::Matrix3d& covariance) {
  const std::string problem = problemOf(odom_from_base, covariance);
  if (!problem.empty()) throw std::invalid_argument(problem);
}

constexpr double kLongLate = 0.5;  // [s] messages are not on their way for longer: the sensors' clocks may differ

/// The end of a reason: a stamp beside those of the odometry at hand.
std::string besideOdometry(Stamp stamp, const OdometryBuffer& odometry) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(3) << ": its stamp is " << seconds(stamp) << " s, ";
  if (odometry.empty()) return text.str() + "there is no odometry";
  text << "those of the odometry are " << seconds(odometry.oldest()) << " to " << seconds(odometry.newest()) << " s";
  if (odometry.covers(stamp)) return text.str();
  const double apart = seconds(std::max(odometry.oldest() - stamp, stamp - odometry.newest()));
  text << ", " << apart << " s away" << (apart > kLongLate ? ": are the clocks synchronised?" : "");
  return text.str();
}

std::string besideEstimate(Stamp stamp, Stamp estimate) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(3) << ": its stamp is " << seconds(stamp) << " s, that of the estimate "
       << seconds(estimate) << " s, " << seconds(estimate - stamp) << " s later";
  return text.str();
}

LaserConstants constantsOf(const PipelineOptions& options) {
  return {LaserConstant(options.range_offset_std), LaserConstant(options.sweep_duration_std)};
}

}  // namespace

ScanOdometry::ScanOdometry(const PipelineOptions& options, const SE2& odom_from_base, const Eigen::Matrix3d& covariance,
                           const Found& before)
    : options_(options),
      lasers_(options.lasers, {constantsOf(options), {}, {}, std::nullopt}),
      odometry_(options.motion, options.odometry_timeout),
      imu_(options.imu.timeout),
      twist_(options.twist_window),
      start_(odom_from_base),
      start_covariance_(covariance),
      before_(before),
      filter_twist_(options.twist_window),
      displacements_(options, options.lasers),
      landmarks_(options.landmarks) {
  check(options);
  checkPose(odom_from_base, covariance);
  for (std::size_t i = 0; i < std::min(lasers_.size(), before.lasers.size()); ++i) {
    lasers_[i].constants = before.lasers[i];
  }
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
    given_up_.push_back(
        notUsed(given_up.scan.stamp, given_up.laser, ScanOutcome::kNoOdometry,
                "too many scans wait for odometry at their stamps" + besideOdometry(given_up.scan.stamp, odometry_)));
  }
}

std::vector<ScanReport> ScanOdometry::process() {
  std::vector<ScanReport> reports;
  reports.swap(given_up_);
  bool held_back = false;
  while (!waiting_.empty() && imuTells(waiting_.endOfOldest())) {
    const bool bracketed = filter_ && waiting_.endOfOldest() <= odometry_.newest();
    if (olderMayCome() || (!bracketed && !bridgeToOldestWaiting())) break;
    held_back = held_back || oldestHoldsBack();
    takePoses(waiting_.oldest());
    reports.push_back(take(waiting_.takeOldest()));
  }
  if (held_back) followAtADistance();
  if (filter_) takePoses(filter_stamp_);  // which come late
  return reports;
}

/// Of the scans that wait: for the end of its sweep, or for those of other lasers. The filter does not pass it
/// meanwhile.
bool ScanOdometry::oldestHoldsBack() const { return waiting_.endOfOldest() > waiting_.oldest() || options_.lasers > 1; }

/// Lasers need their time for a scan, the slow ones more; their stamps are of its beginning.
bool ScanOdometry::olderMayCome() const {
  if (options_.lasers == 1 || waiting_.areOfAll(options_.lasers)) return false;
  const Stamp now = odometry_.empty() ? waiting_.newest() : std::max(waiting_.newest(), odometry_.newest());
  return now < waiting_.oldest() + toDuration(options_.scan_patience);
}

ScanReport ScanOdometry::take(const WaitingScans::Entry& waiting) {
  const Stopwatch stopwatch;
  const Stamp stamp = waiting.scan.stamp;
  if (!odometry_.covers(stamp)) {
    return notUsed(stamp, waiting.laser, ScanOutcome::kNoOdometry,
                   "older than the odometry at hand" + besideOdometry(stamp, odometry_));
  }
  Laser& laser = lasers_[waiting.laser];
  if (stamp < filter_stamp_ || laser.taken == stamp) {
    return notUsed(stamp, waiting.laser, ScanOutcome::kOutOfOrder,
                   "not newer than the estimate" + besideEstimate(stamp, filter_stamp_));
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
  laser.no_return.look(waiting.scan);
  report.no_return = laser.no_return;
  report.scan = prepared(waiting, report.reason);
  if (report.scan) {
    correctBy(report);  // (16)-(23)
  } else {
    report.outcome = ScanOutcome::kUnusable;
  }
  if (at_before) followScans(before, *at_before, report);
  if (report.new_reference) displacements_.becomeReference(report, *filter_);  // (24)-(27)
  report.estimate = estimate();
  report.in_map = inMap();
  report.calibration = filter_->calibration();
  report.gyro_bias = filter_->gyroBias();
  report.laser_constants = laser.constants;
  report.gyro_time = std::exchange(gyro_time_, 0.0);
  report.stands = standstill_.stands(options_.standstill);
  leaveTrail();
  carried_on_.reset();
  carryOn();
  report.total_time = stopwatch.seconds();
  return report;
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

std::shared_ptr<const PreparedScan> ScanOdometry::prepared(const WaitingScans::Entry& waiting,
                                                           std::string& rejection) const {
  const Laser& laser = lasers_[waiting.laser];
  ScanOptions options = options_.scan;
  options.range_max = std::min(options.range_max, laser.no_return.value());
  options.range_offset = laser.constants.range_offset.value();
  options.sweep = evenSweep(waiting);
  return prepareScan(waiting.scan, waiting.base_from_laser, options, &rejection, motionDuring(waiting));
}

void ScanOdometry::correctBy(ScanReport& report) {
  claimLandmarks(report);
  if (!displacements_.hasReference(report.laser)) {
    report.new_reference = true;
  } else if (!options_.landmarks.only) {
    displacements_.update(report, *filter_);
    if (wasUsed(report.outcome)) lasers_[report.laser].constants.learn(report.match, *report.scan);
  }
  useLandmarks(report);
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

std::optional<Estimate> ScanOdometry::latest() const {
  if (!latest_) return std::nullopt;
  return Estimate{latest_->stamp, latest_->estimate.pose(), latest_->estimate.covariance(), twist_.twist()};
}

bool ScanOdometry::setPose(const SE2& odom_from_base, const Eigen::Matrix3d& covariance, Stamp stamp) {
  checkPose(odom_from_base, covariance);
  if (!filter_) turnFloor(odom_from_base.yaw - start_.yaw);
  start_ = odom_from_base;
  start_covariance_ = covariance;
  if (!filter_) return true;
  PoseMeasurement now{odom_from_base, covariance};
  const bool is_past = stamp <= filter_stamp_;
  const std::optional<PoseMeasurement> brought_forward = is_past ? broughtForward({stamp, now}) : std::nullopt;
  const bool is_known = brought_forward || (!is_past && odometry_.covers(stamp));
  const Stamp newest = odometry_.newest();
  const bool is_now = stamp > newest && stamp <= newest + toDuration(options_.odometry_timeout);
  if (brought_forward) {
    now = *brought_forward;
  } else {
    propagateTo(is_known ? stamp : newest);
  }
  trail_.move(compose(now.pose, inverse(filter_->pose())));  // by which the next pose may be brought forward
  begin(now.pose, now.covariance, filter_stamp_);
  return is_known || is_now;
}

void ScanOdometry::setOptions(const PipelineOptions& options) {
  checkChange(options_, options);
  options_ = options;
  displacements_.setOptions(options);
  for (Laser& laser : lasers_) {
    laser.constants.range_offset.setStd(options.range_offset_std);
    laser.constants.sweep_duration.setStd(options.sweep_duration_std);
  }
  landmarks_.setOptions(options.landmarks);
  odometry_.setLimits(options.motion, options.odometry_timeout);
  twist_.setDuration(options.twist_window);
  filter_twist_.setDuration(options.twist_window);
}

void ScanOdometry::begin(const SE2& odom_from_base, const Eigen::Matrix3d& covariance, Stamp stamp) {
  StateOptions states = statesFor(options_.calibration, options_.imu);
  before_ = found();
  if (filter_) turnFloor(odom_from_base.yaw - filter_->pose().yaw);
  states.known_calibration = before_.calibration;
  states.known_gyro_bias = before_.gyro_bias;
  const Eigen::Matrix3d P = withYawUpToATurn(symmetric(covariance));
  map_ = nullptr;
  if (options_.pose_updates.on) {
    auto odom = std::make_unique<MultiCloneFilter>(odom_from_base, P, states);
    auto map = std::make_unique<MapFilter>(std::move(odom));
    map_ = map.get();
    filter_ = std::move(map);
  } else {
    filter_ = makeFusionMethod(options_.method, odom_from_base, P, states);  // (6)(7)
  }
  filter_stamp_ = stamp;
  leaveTrail();
  filter_twist_ = TwistWindow(options_.twist_window);
  odometry_.discardBefore(stamp);
  wheels_known_ = true;
  standstill_.interrupt();
  imu_.forgetTaken();
  displacements_ = DisplacementUpdates(options_, options_.lasers);
  for (Laser& laser : lasers_) laser.taken.reset();
  landmarks_ = Landmarks(options_.landmarks);
  carried_on_.reset();
  carryOn();
}

/// What is known of it is told in x and y of odom, in which the robot is told to face elsewhere.
void ScanOdometry::turnFloor(double yaw) {
  if (before_.calibration) before_.calibration = before_.calibration->turnedWithTheRobot(wrapAngle(yaw));
}

Found ScanOdometry::found() const {
  Found found = before_;
  if (filter_ && filter_->calibration().covariance != WheelCalibration::Matrix::Zero())
    found.calibration = filter_->calibration();
  if (filter_ && filter_->gyroBias().variance > 0.0) found.gyro_bias = filter_->gyroBias();
  found.lasers.clear();
  for (const Laser& laser : lasers_) found.lasers.push_back(laser.constants);
  return found;
}

Estimate ScanOdometry::estimate() const {
  return {filter_stamp_, filter_->pose(), filter_->covariance(), twist_.twist()};
}

}  // namespace sckf
