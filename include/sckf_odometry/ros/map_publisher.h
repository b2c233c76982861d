// What the node publishes of the estimate in map.
#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <tf2_ros/transform_broadcaster.h>

#include "sckf_odometry/pipeline/pose_updates.h"
#include "sckf_odometry/ros/parameters.h"

namespace sckf {

class MapPublisher {
 public:
  /// Advertises nothing unless absolute poses are used.
  MapPublisher(ros::NodeHandle nh, const Options& options);

  /// pose_in_map and, if asked for, map_frame → odom_frame on TF, unless something as new has been published.
  void publish(const MapEstimate& estimate);

  /// A new time begins.
  void restart() { newest_ = Stamp(0); }

 private:
  NodeOptions options_;
  ros::Publisher pose_;
  tf2_ros::TransformBroadcaster broadcaster_;
  Stamp newest_{0};
};

}  // namespace sckf
