#include "sckf_odometry/ros/estimate_publisher.h"

#include <algorithm>
#include <iterator>

#include "sckf_odometry/ros/constants.h"
#include "sckf_odometry/ros/conversions.h"

namespace sckf {

namespace {

constexpr std::size_t kMaxSent = 1000;  // transforms that may be on their way through TF

}  // namespace

EstimatePublisher::EstimatePublisher(ros::NodeHandle nh, const NodeOptions& options)
    : options_(options),
      odometry_(nh.advertise<nav_msgs::Odometry>("odometry/filtered", kPublisherQueue)),
      pose_(nh.advertise<geometry_msgs::PoseWithCovarianceStamped>("pose", kPublisherQueue)),
      path_(nh.advertise<nav_msgs::Path>("path", 1, true)),
      path_odometry_(nh.advertise<nav_msgs::Path>("path_odometry", 1, true)),
      cloud_(nh.advertise<sensor_msgs::PointCloud2>("cloud", 1, true)),
      path_recorder_(options.path_distance, options.path_max_poses),
      wheels_recorder_(options.path_distance, options.path_max_poses),
      cloud_recorder_(options.cloud_resolution, options.cloud_max_points) {}

void EstimatePublisher::publish(const Estimate& estimate) {
  if (last_published_ && estimate.stamp <= last_published_->stamp) return;
  last_published_ = estimate;
  odometry_.publish(toOdometryMessage(estimate, options_.odom_frame, options_.base_frame));
  publishTransform(estimate);
}

void EstimatePublisher::publishTransform(const Estimate& estimate) {
  if (!options_.publish_tf) return;
  // A frame has one parent: where base_frame has one already, odom_frame is hung below it.
  const SE2& pose = estimate.odom_from_base;
  const geometry_msgs::TransformStamped transform =
      options_.invert_odom_tf ? toTransform(inverse(pose), estimate.stamp, options_.base_frame, options_.odom_frame)
                              : toTransform(pose, estimate.stamp, options_.odom_frame, options_.base_frame);
  broadcaster_.sendTransform(transform);
  sent_.push_back(transform);
  if (sent_.size() > kMaxSent) sent_.pop_front();
}

bool EstimatePublisher::takeSent(const geometry_msgs::TransformStamped& transform) {
  const auto found = std::find(sent_.begin(), sent_.end(), transform);
  if (found == sent_.end()) return false;
  sent_.erase(sent_.begin(), std::next(found));
  return true;
}

void EstimatePublisher::publishScan(const Estimate& estimate, const PreparedScan* scan) {
  pose_.publish(toPoseMessage(estimate.stamp, estimate.odom_from_base, estimate.covariance, options_.odom_frame));
  path_recorder_.add(estimate.stamp, estimate.odom_from_base);
  if (scan != nullptr) {
    cloud_recorder_.add(estimate.odom_from_base, scan->points.point);
    cloud_recorder_.add(estimate.odom_from_base, scan->set_aside);
    cloud_stamp_ = estimate.stamp;
  }
  views_changed_ = true;
}

void EstimatePublisher::addWheels(const OdometrySample& sample) {
  if (!odom_from_wheels_) {
    if (!last_published_ || last_published_->stamp != sample.stamp) return;
    odom_from_wheels_ = compose(last_published_->odom_from_base, inverse(sample.odom_from_base));
  }
  wheels_recorder_.add(sample.stamp, compose(*odom_from_wheels_, sample.odom_from_base));
  views_changed_ = true;
}

void EstimatePublisher::publishViews() {
  if (!views_changed_) return;
  views_changed_ = false;
  path_.publish(path_recorder_.message(options_.odom_frame));
  path_odometry_.publish(wheels_recorder_.message(options_.odom_frame));
  cloud_.publish(cloud_recorder_.message(cloud_stamp_, options_.odom_frame));
}

void EstimatePublisher::restart() {
  last_published_.reset();
  clearViews();
}

void EstimatePublisher::clearViews() {
  odom_from_wheels_.reset();
  path_recorder_ = PathRecorder(options_.path_distance, options_.path_max_poses);
  wheels_recorder_ = path_recorder_;
  cloud_recorder_ = CloudRecorder(options_.cloud_resolution, options_.cloud_max_points);
  views_changed_ = true;
}

}  // namespace sckf
