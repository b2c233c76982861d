#include "sckf_odometry/pipeline/map_filter.h"

namespace sckf {

std::string toString(PoseOutcome outcome) {
  switch (outcome) {
    case PoseOutcome::kEntered:
      return "entered";
    case PoseOutcome::kUsed:
      return "used";
    case PoseOutcome::kContradicts:
      return "contradicts";
    case PoseOutcome::kTooLate:
      return "too late";
    case PoseOutcome::kNoOdometry:
      return "no odometry";
    case PoseOutcome::kNoPose:
      return "no pose";
  }
  return "unknown";
}

void MapFilter::propagate(const OdometryIncrement& increment) {
  odom_->propagate(increment);
  if (map_) map_->propagate(increment);
}

void MapFilter::age(double dt) {
  odom_->age(dt);
  if (map_) map_->age(dt);
}

void MapFilter::loosen(const Eigen::Matrix3d& covariance) {
  odom_->loosen(covariance);
  if (map_) map_->loosen(covariance);
}

void MapFilter::beginScan() {
  odom_->beginScan();
  if (map_) map_->beginScan();
}

void MapFilter::update(const Displacement& displacement, const Innovation& innovation) {
  odom_->update(displacement, innovation);
  if (map_) map_->update(displacement, map_->innovation(displacement));
}

double MapFilter::updateHeading(double yaw, double variance, double nis_bound) {
  if (map_) map_->updateHeading(yaw, variance, nis_bound);
  return odom_->updateHeading(yaw, variance, nis_bound);
}

void MapFilter::clone(const Eigen::VectorXd& range_variances) {
  odom_->clone(range_variances);
  if (map_) map_->clone(range_variances);
}

void MapFilter::forget(std::size_t clone) {
  odom_->forget(clone);
  if (map_) map_->forget(clone);
}

void MapFilter::addLandmark(const Sighting& sighting) {
  odom_->addLandmark(sighting);
  if (map_) map_->addLandmark(sighting);
}

void MapFilter::forgetLandmark(std::size_t number) {
  odom_->forgetLandmark(number);
  if (map_) map_->forgetLandmark(number);
}

void MapFilter::update(std::size_t landmark, const Sighting& sighting) {
  odom_->update(landmark, sighting);
  if (map_) map_->update(landmark, sighting);
}

PoseOutcome MapFilter::update(const PoseMeasurement& map_from_base, double nis_bound, int max_rejected, double* nis) {
  if (nis != nullptr) *nis = 0.0;
  if (!map_) return enter(map_from_base);
  const double contradiction = map_->update(map_from_base, nis_bound);
  if (nis != nullptr) *nis = contradiction;
  if (contradiction <= nis_bound) {
    rejected_ = 0;
    return PoseOutcome::kUsed;
  }
  return ++rejected_ < max_rejected ? PoseOutcome::kContradicts : enter(map_from_base);
}

PoseOutcome MapFilter::enter(const PoseMeasurement& map_from_base) {
  map_ = std::make_unique<MultiCloneFilter>(*odom_);
  map_->enterWorld(map_from_base);
  rejected_ = 0;
  return PoseOutcome::kEntered;
}

}  // namespace sckf
