// Messages that tell where the robot is in map: refused, counted, and it is said why.
#pragma once

#include <geometry_msgs/PoseWithCovarianceStamped.h>

#include <optional>
#include <string>

#include "sckf_odometry/pipeline/pose_updates.h"
#include "sckf_odometry/ros/health.h"
#include "sckf_odometry/ros/parameters.h"
#include "sckf_odometry/ros/warnings.h"

namespace sckf {

class PoseUpdateInput {
 public:
  /// health and warnings must live as long as this.
  PoseUpdateInput(const NodeOptions& options, const std::string& topic, Health& health, Warnings& warnings);

  /// Empty if it cannot be used.
  std::optional<PoseUpdate> admit(const geometry_msgs::PoseWithCovarianceStamped& message);

  /// What the pipeline made of a pose.
  void ended(const PoseReport& report);

  const std::string& topic() const { return topic_; }

 private:
  void refuse(const std::string& kind, const std::string& reason);

  std::string map_frame_;
  std::string topic_;
  Health& health_;
  Warnings& warnings_;
};

}  // namespace sckf
