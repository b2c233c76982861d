// The last pose on disk, for a node that is started again.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "sckf_odometry/pipeline/scan_odometry.h"
#include "sckf_odometry/ros/parameters.h"

namespace sckf {

/// Where base_frame was in odom_frame.
struct SavedPose {
  std::string odom_frame;
  std::string base_frame;
  Stamp stamp{0};
  SE2 odom_from_base;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of the additive error in x, y, yaw
};

/// A YAML file that is complete or the one before: written beside, then renamed.
class StateFile {
 public:
  explicit StateFile(const std::string& path) : path_(path) {}

  /// Empty if there is no file; or if it cannot be used: then `problem` names the file, what it says and what is
  /// expected.
  std::optional<SavedPose> read(std::string* problem) const;

  /// Returns whether it could be written; if not, `problem` names the file and says why.
  bool write(const SavedPose& pose, std::string* problem) const;

 private:
  std::string path_;
};

/// Keeps the estimate in the file that ~state_file names, for as long as it is wanted.
class PoseKeeper {
 public:
  /// Reads the file; a problem is said on the console.
  explicit PoseKeeper(const NodeOptions& options);

  /// The pose of before, if there is one that is not too old at the first odometry. It can be taken up once.
  std::optional<SavedPose> takeUp(Stamp first_odometry);

  /// What was read is not wanted any more: somebody has said where the robot is.
  void forget() { saved_.reset(); }

  /// Writes the estimate, unless it is there already. Returns what is wrong, empty if nothing is.
  std::string keep(const Estimate& estimate);

 private:
  NodeOptions options_;
  std::optional<SavedPose> saved_;
  Stamp written_{0};
};

}  // namespace sckf
