// All that the node publishes of the estimate.
#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <tf2_ros/transform_broadcaster.h>

#include <deque>
#include <optional>

#include "sckf_odometry/ros/parameters.h"
#include "sckf_odometry/ros/recorders.h"

namespace sckf {

class EstimatePublisher {
 public:
  EstimatePublisher(ros::NodeHandle nh, const NodeOptions& options);

  /// odometry/filtered and TF, unless something as new has been published: each stamp once, in increasing order.
  void publish(const Estimate& estimate);

  /// The estimate at a scan: pose, at the scan's own stamp, even if the wheels have carried it further already. It and
  /// the scan's points, null if it was not usable, go to what publishViews() shows.
  void publishScan(const Estimate& estimate, const PreparedScan* scan);

  /// The wheels alone, drawn from where the estimate began.
  void addWheels(const OdometrySample& sample);

  /// path, path_odometry and cloud, if there is anything new.
  void publishViews();

  /// A new estimate begins, at the same time: what is drawn begins anew, and still no stamp comes twice.
  void clearViews();

  /// A new estimate begins, and a new time.
  void restart();

  /// Whether a transform that came back from TF is one that was sent here; each comes back once, in order.
  bool takeSent(const geometry_msgs::TransformStamped& transform);

 private:
  void publishTransform(const Estimate& estimate);

  NodeOptions options_;
  ros::Publisher odometry_;
  ros::Publisher pose_;
  ros::Publisher path_;
  ros::Publisher path_odometry_;
  ros::Publisher cloud_;
  tf2_ros::TransformBroadcaster broadcaster_;
  std::deque<geometry_msgs::TransformStamped> sent_;  // and not yet come back

  std::optional<Estimate> last_published_;
  std::optional<SE2> odom_from_wheels_;  // where the frame of the driver's odometry is in odom
  PathRecorder path_recorder_;
  PathRecorder wheels_recorder_;
  CloudRecorder cloud_recorder_;
  Stamp cloud_stamp_{0};
  bool views_changed_ = false;
};

}  // namespace sckf
