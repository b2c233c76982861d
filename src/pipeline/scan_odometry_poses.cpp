// What ScanOdometry does with absolute poses.
#include <algorithm>
#include <sstream>
#include <utility>

#include "sckf_odometry/core/covariance.h"
#include "sckf_odometry/pipeline/chi_squared.h"
#include "sckf_odometry/pipeline/scan_odometry.h"

namespace sckf {

void ScanOdometry::addPose(const PoseUpdate& pose) {
  const PoseMeasurement& z = pose.map_from_base;
  if (!isTime(pose.stamp) || !problemOf(z.pose, z.covariance).empty() || !isPositiveDefinite(z.covariance)) {
    const char* const expected = "finite numbers and a positive definite covariance expected";
    pose_reports_.push_back(notUsed(pose.stamp, PoseOutcome::kNoPose, expected));
  } else if (const auto given_up = waiting_poses_.add(pose)) {
    pose_reports_.push_back(notUsed(given_up->stamp, PoseOutcome::kNoOdometry, "too many poses wait for odometry"));
  }
}

std::vector<PoseReport> ScanOdometry::takePoseReports() { return std::exchange(pose_reports_, {}); }

void ScanOdometry::takePoses(Stamp up_to) {
  if (map_ == nullptr) return;
  while (const auto pose = waiting_poses_.takeUpTo(std::min(up_to, odometry_.newest()))) {
    pose_reports_.push_back(take(*pose));
  }
}

PoseReport ScanOdometry::take(const PoseUpdate& pose) {
  if (pose.stamp > filter_stamp_) propagateTo(pose.stamp);
  const std::optional<PoseMeasurement> now = broughtForward(pose);
  if (!now) return notUsed(pose.stamp, PoseOutcome::kTooLate, "older than the estimate, and than what is kept of it");
  PoseReport report;
  report.stamp = pose.stamp;
  report.nis_bound = chiSquared(3, options_.gate.probability);
  report.outcome = map_->update(*now, report.nis_bound, options_.pose_updates.max_rejected, &report.nis);
  if (report.outcome == PoseOutcome::kContradicts) {
    std::ostringstream text;
    text << "normalised innovation squared " << report.nis << " exceeds " << report.nis_bound;
    report.reason = text.str();
  }
  report.in_map = inMap();
  return report;
}

/// The pose at filter_stamp_: by the motion since, which errs as wheels do.
std::optional<PoseMeasurement> ScanOdometry::broughtForward(const PoseUpdate& pose) const {
  if (pose.stamp == filter_stamp_) return pose.map_from_base;
  const std::optional<SE2> then = trail_.at(pose.stamp);
  if (!then) return std::nullopt;
  const OdometryIncrement motion = modelledIncrement(between(*then, filter_->pose()), options_.odometry_noise);
  Eigen::Matrix3d F;
  Eigen::Matrix3d G;
  PoseMeasurement now;
  now.pose = compose(pose.map_from_base.pose, motion.before_from_after, &F, &G);
  now.covariance = symmetric(F * pose.map_from_base.covariance * F.transpose() + G * motion.covariance * G.transpose());
  return now;
}

std::optional<MapEstimate> ScanOdometry::inMap() const {
  if (map_ == nullptr || map_->inMap() == nullptr) return std::nullopt;
  const SE2 map_from_base = map_->inMap()->pose();
  return MapEstimate{filter_stamp_, map_from_base, map_->inMap()->covariance(),
                     compose(map_from_base, inverse(filter_->pose()))};
}

}  // namespace sckf
