// How the estimate follows the motion between scans: by wheels, by an IMU, by scans alone where the wheels are silent.
#include <algorithm>
#include <cmath>

#include "sckf_odometry/core/covariance.h"
#include "sckf_odometry/pipeline/scan_odometry.h"

namespace sckf {

namespace {

/// So many scans beyond the time-out mean that the wheels are silent; one may have a wrong stamp.
constexpr std::size_t kConfirmations = 3;

}  // namespace

/// The odometry at hand covers it, the filter is at its beginning.
ScanMotion ScanOdometry::motionDuring(const WaitingScans::Entry& waiting) const {
  ScanMotion motion;
  Standstill standstill = standstill_;
  SE2 at = filter_->pose();
  for (const OdometryBuffer::Step& step : odometry_.steps(waiting.scan.stamp, waiting.end())) {
    const SE2 moved = filter_->refined(increment(step, standstill), at.yaw).before_from_after;
    motion.add(moved, seconds(step.to.stamp - step.from.stamp));
    at = compose(at, moved);
  }
  return motion;
}

/// By the motion up to the stamp: a scan need not wait for what comes after. A twist that the robot cannot have, as of
/// odometry with wrong stamps, tells nothing.
EvenSweep ScanOdometry::evenSweep(const WaitingScans::Entry& waiting) const {
  if (waiting.sweep.deskewing == Deskewing::kDone) return {};
  const Twist twist = filter_twist_.twist();
  const bool known = twist.covariance(0, 0) < Twist::kUnknownVariance;
  if (!known || !isPossible(twist.mean, options_.motion)) return {};
  return {twist.mean, lasers_[waiting.laser].constants.sweep_duration.value()};
}

/// Without scans the filter follows the wheels at a distance, so that the buffer stays small; from sample to sample, so
/// that it makes no difference when the samples arrived.
void ScanOdometry::followAtADistance() {
  Stamp too_old = odometry_.newest() - toDuration(options_.max_scan_delay);
  if (!waiting_.empty() && oldestHoldsBack()) too_old = std::min(too_old, waiting_.oldest());
  if (too_old <= filter_stamp_) return;
  odometry_.discardBefore(filter_stamp_);  // for which a sample may have come just now
  const Stamp last = odometry_.lastUpTo(too_old);
  takePoses(last);
  if (last > filter_stamp_) propagateTo(last);
  if (carried_on_->stamp < filter_stamp_) carryOn();
}

void ScanOdometry::propagateTo(Stamp stamp) {
  for (const OdometryBuffer::Step& step : odometry_.steps(filter_stamp_, stamp)) {
    const OdometryIncrement motion = increment(step, standstill_);
    const double dt = seconds(step.to.stamp - step.from.stamp);
    filter_twist_.add(filter_->refined(motion, filter_->pose().yaw), dt);
    filter_->propagate(motion);
    filter_->age(dt);
    filter_stamp_ = step.to.stamp;
    leaveTrail();
    for (const MotionMeasurement& z : motion.measured) gyro_time_ += z.bias_time;
    if (!step.guess) continue;
    wheels_known_ = false;
    filter_twist_ = TwistWindow(options_.twist_window);
  }
  filter_stamp_ = stamp;
  odometry_.discardBefore(stamp);
  imu_.discardBefore(stamp);
}

void ScanOdometry::leaveTrail() { trail_.add(filter_stamp_, filter_->pose(), options_.max_scan_delay); }

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
  return std::max(carried_on_->stamp, odometry_.lastUpTo(std::max(imu_.newest(), carried_on_->stamp)));
}

void ScanOdometry::carryOn() {
  if (!carried_on_ || carried_on_->stamp < filter_stamp_) {
    carried_on_ = CarriedOn{{filter_->pose(), filter_->covariance()}, filter_stamp_, standstill_};
  }
  const auto carry = [this](CarriedOn& carried, Stamp to) {
    for (const OdometryBuffer::Step& step : odometry_.steps(carried.stamp, to)) {
      carried.estimate.propagate(filter_->refined(increment(step, carried.standstill), carried.estimate.pose().yaw));
    }
    carried.stamp = to;
  };
  carry(*carried_on_, settled());
  latest_ = carried_on_;
  carry(*latest_, odometry_.newest());
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
  const double yaw = latest_ ? latest_->estimate.pose().yaw : start_.yaw;
  for (const OdometryBuffer::Step& step : odometry_.steps(since, odometry_.newest())) {
    if (step.guess) continue;
    twist_.add(filter_->refined(byWheels(step), yaw), seconds(step.to.stamp - step.from.stamp));
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
    return statedIncrement(motion, *stated, seconds(step.to.stamp - step.from.stamp), step.interval);
  }
  return modelledIncrement(motion, options_.odometry_noise);
}

}  // namespace sckf
