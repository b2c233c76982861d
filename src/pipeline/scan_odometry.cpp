#include "sckf_odometry/pipeline/scan_odometry.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "sckf_odometry/core/covariance.h"
#include "sckf_odometry/pipeline/stopwatch.h"

namespace sckf {

namespace {

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

LaserConstants constantsOf(const PipelineOptions& options) {
  return {LaserConstant(options.range_offset_std), LaserConstant(options.sweep_duration_std)};
}

}  // namespace

ScanOdometry::ScanOdometry(const PipelineOptions& options, const SE2& odom_from_base, const Eigen::Matrix3d& covariance)
    : options_(options),
      matcher_(options.matcher),
      lasers_(options.lasers, {ReferencePolicy(options.reference), constantsOf(options), {}, std::nullopt}),
      odometry_(options.motion, options.odometry_timeout),
      imu_(options.imu.timeout),
      twist_(options.twist_window),
      start_(odom_from_base),
      start_covariance_(covariance),
      filter_twist_(options.twist_window),
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
  const Stopwatch stopwatch;
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
  report.scan = prepared(waiting, report.reason);
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
    if (laser.failures > 0) admitFailure(report);
    allowForCommonErrors(report);
    filter_->clone(report.scan->rangeVariances());  // (24)-(27)
    references_.add(report.scan, report.laser, options_.reference.kept, *filter_);
  }
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

std::shared_ptr<const PreparedScan> ScanOdometry::prepared(const WaitingScans::Entry& waiting,
                                                           std::string& rejection) const {
  ScanOptions options = options_.scan;
  options.range_offset = lasers_[waiting.laser].constants.range_offset.value();
  options.sweep = evenSweep(waiting);
  return prepareScan(waiting.scan, waiting.base_from_laser, options, &rejection, motionDuring(waiting));
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
  for (Laser& laser : lasers_) {
    laser.policy.setOptions(options.reference);
    laser.constants.range_offset.setStd(options.range_offset_std);
    laser.constants.sweep_duration.setStd(options.sweep_duration_std);
  }
  landmarks_.setOptions(options.landmarks);
  odometry_.setLimits(options.motion, options.odometry_timeout);
  twist_.setDuration(options.twist_window);
  filter_twist_.setDuration(options.twist_window);
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
  filter_twist_ = TwistWindow(options_.twist_window);
  odometry_.discardBefore(stamp);
  wheels_known_ = true;
  standstill_.interrupt();
  imu_.forgetTaken();
  references_.clear();
  for (Laser& laser : lasers_) {
    laser.policy = ReferencePolicy(options_.reference);
    laser.constants = constantsOf(options_);
    laser.taken.reset();
    laser.failures = 0;
  }
  landmarks_ = Landmarks(options_.landmarks);
  carried_on_.reset();
  carryOn();
}

Estimate ScanOdometry::estimate() const {
  return {filter_stamp_, filter_->pose(), filter_->covariance(), twist_.twist()};
}

}  // namespace sckf
