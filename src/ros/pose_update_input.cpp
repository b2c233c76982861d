#include "sckf_odometry/ros/pose_update_input.h"

#include <sstream>

#include "sckf_odometry/core/covariance.h"
#include "sckf_odometry/ros/conversions.h"

namespace sckf {

PoseUpdateInput::PoseUpdateInput(const NodeOptions& options, const std::string& topic, Health& health,
                                 Warnings& warnings)
    : map_frame_(options.map_frame), topic_(topic), health_(health), warnings_(warnings) {}

std::optional<PoseUpdate> PoseUpdateInput::admit(const geometry_msgs::PoseWithCovarianceStamped& message) {
  health_.pose_updates.came(message.header.stamp, ros::Time::now());
  std::string problem;
  const std::optional<GivenPose> pose = toGivenPose(message, map_frame_, &problem);
  if (message.header.stamp.isZero()) {
    refuse("no stamp", "header.stamp is 0: the time at which the robot was there expected");
  } else if (!pose) {
    refuse("no pose", problem);
  } else if (!isPositiveDefinite(pose->covariance)) {
    refuse("no covariance", "the variances of x, y and yaw are " + std::to_string(pose->covariance(0, 0)) + ", " +
                                std::to_string(pose->covariance(1, 1)) + " and " +
                                std::to_string(pose->covariance(2, 2)) +
                                ": a positive definite covariance expected, since nothing is known exactly");
  } else {
    return PoseUpdate{pose->stamp, {pose->odom_from_base, pose->covariance}};
  }
  return std::nullopt;
}

void PoseUpdateInput::ended(const PoseReport& report) {
  health_.poseUpdateTaken(report);
  if (!report.reason.empty()) {
    warnings_.warn("pose update " + toString(report.outcome),
                   "pose on " + topic_ + " not used: " + toString(report.outcome) + ": " + report.reason);
  }
  if (report.outcome != PoseOutcome::kEntered) return;
  const SE2& pose = report.in_map->map_from_base;
  std::ostringstream text;
  text << "the estimate in " << map_frame_ << " begins at " << pose.vector().transpose();
  if (report.nis > report.nis_bound) {
    warnings_.warn("pose update entered", text.str() + ": too many poses on " + topic_ + " contradicted it");
  } else {
    ROS_INFO_STREAM_NAMED("sckf_odometry", text.str());
  }
}

void PoseUpdateInput::refuse(const std::string& kind, const std::string& reason) {
  health_.pose_updates.refused(kind, reason);
  warnings_.warn("pose update " + kind, "pose on " + topic_ + " not used: " + reason);
}

}  // namespace sckf
