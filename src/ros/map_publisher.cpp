#include "sckf_odometry/ros/map_publisher.h"

#include "sckf_odometry/ros/constants.h"
#include "sckf_odometry/ros/conversions.h"

namespace sckf {

MapPublisher::MapPublisher(ros::NodeHandle nh, const Options& options) : options_(options.node) {
  if (!options.pipeline.pose_updates.on) return;
  pose_ = nh.advertise<geometry_msgs::PoseWithCovarianceStamped>("pose_in_map", kPublisherQueue);
}

void MapPublisher::publish(const MapEstimate& estimate) {
  if (estimate.stamp <= newest_) return;
  newest_ = estimate.stamp;
  pose_.publish(toPoseMessage(estimate.stamp, estimate.map_from_base, estimate.covariance, options_.map_frame));
  if (!options_.publish_map_tf) return;
  broadcaster_.sendTransform(
      toTransform(estimate.map_from_odom, estimate.stamp, options_.map_frame, options_.odom_frame));
}

}  // namespace sckf
