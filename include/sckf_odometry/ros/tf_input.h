// What the robot says on TF: the mounts of its lasers and, if asked, its wheel odometry.
#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>

#include <Eigen/Geometry>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "sckf_odometry/pipeline/odometry_buffer.h"

namespace sckf {

/// A TF buffer that the node's own callbacks fill: what has been received, and in which order, is known, and no thread
/// of a listener runs beside. Frames are named without leading slash.
class TfInput {
 public:
  /// time_jump: transforms of the odometry frame that go back in time by more than this clear the buffer.
  TfInput(const std::string& base_frame, const std::string& odometry_frame, Stamp time_jump);

  void add(const tf2_msgs::TFMessage& message, bool is_static);
  void add(const geometry_msgs::TransformStamped& transform, bool is_static);

  /// Forgets all but what is fixed: time begins again, and it would refuse what is older than what it has.
  void clear();

  /// Mounts are looked up again: somebody has corrected them.
  void forgetMounts();

  /// Pose of a frame that is fixed to the robot, in base_frame, looked up once. Empty while TF does not tell; then
  /// `problem` says what is missing.
  std::optional<Eigen::Isometry3d> baseFrom(const std::string& frame, std::string* problem);

  /// Odometry of another frame that is fixed to the robot, as that of base_frame. Empty, with the problem in words,
  /// while TF does not relate the two. An empty child_frame is taken for base_frame: many drivers leave it so.
  std::optional<OdometrySample> inBaseFrame(const OdometrySample& sample, const std::string& child_frame,
                                            std::string* problem);

  /// The poses of base_frame in the odometry frame since the last call, at the stamps at which a transform of the
  /// odometry frame was published.
  std::vector<OdometrySample> takeOdometry();

  /// What keeps takeOdometry() from telling anything, empty if nothing does.
  const std::string& odometryProblem() const { return odometry_problem_; }

 private:
  void noteOdometryStamp(const ros::Time& stamp);

  std::string base_frame_;
  std::string odometry_frame_;
  Stamp time_jump_;
  tf2::BufferCore buffer_;
  std::map<std::string, Eigen::Isometry3d> mounts_;
  std::deque<ros::Time> odometry_stamps_;  // published, not yet taken
  ros::Time newest_odometry_;
  int backwards_ = 0;  // transforms in a row that lie far before the newest
  std::string odometry_problem_;
};

}  // namespace sckf
