// The node: messages in, the pipeline, messages out. The nodelet and the standalone node are this class.
#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <nav_msgs/Odometry.h>
#include <ros/message_event.h>
#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <ros/wall_timer.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_msgs/TFMessage.h>

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "sckf_odometry/pipeline/scan_odometry.h"
#include "sckf_odometry/ros/debug_view.h"
#include "sckf_odometry/ros/estimate_publisher.h"
#include "sckf_odometry/ros/health.h"
#include "sckf_odometry/ros/imu_input.h"
#include "sckf_odometry/ros/input_gate.h"
#include "sckf_odometry/ros/map_publisher.h"
#include "sckf_odometry/ros/parameters.h"
#include "sckf_odometry/ros/pose_update_input.h"
#include "sckf_odometry/ros/reconfigure.h"
#include "sckf_odometry/ros/scans_without_mount.h"
#include "sckf_odometry/ros/second_parent.h"
#include "sckf_odometry/ros/services.h"
#include "sckf_odometry/ros/state_file.h"
#include "sckf_odometry/ros/tf_input.h"
#include "sckf_odometry/ros/warnings.h"

namespace sckf {

/// Subscribes to scan or cloud_in, to odom (nav_msgs/Odometry) or TF and, if asked for, to imu and pose_update,
/// publishes what EstimatePublisher and DebugView say, status and diagnostics, and serves what Services and Reconfigure
/// say. Its callbacks may come from any number of threads.
class ScKfOdometryNode {
 public:
  /// Throws std::invalid_argument if a parameter is bad: parameter, value, what is allowed.
  ScKfOdometryNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh);
  ScKfOdometryNode(const ScKfOdometryNode&) = delete;
  ScKfOdometryNode& operator=(const ScKfOdometryNode&) = delete;
  ~ScKfOdometryNode();

 private:
  void subscribe(ros::NodeHandle& nh);
  void startTimers(ros::NodeHandle& nh);
  Services::Actions serviceActions();

  void onScan(std::size_t laser, const sensor_msgs::LaserScan::ConstPtr& message);
  void onCloud(std::size_t laser, const sensor_msgs::PointCloud2::ConstPtr& message);
  void onImu(const sensor_msgs::Imu::ConstPtr& message);
  void onPoseUpdate(const geometry_msgs::PoseWithCovarianceStamped::ConstPtr& message);
  void onOdometry(const nav_msgs::Odometry::ConstPtr& message);
  void onTransforms(const ros::MessageEvent<const tf2_msgs::TFMessage>& event, bool is_static);
  void onOptions(const Options& options);
  void setViewRate();
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  /// Runs a callback: one at a time, and nothing that it throws gets into the process that others live in too.
  template <typename Callback>
  void guarded(const Callback& callback);

  void addScans(std::size_t laser, const InputGate::Scans& admission);
  void addOdometry(const InputGate::Samples& admission);
  void addOdometry(const OdometrySample& sample);

  /// Everything that has become possible with the message that just came.
  void advance();
  void passScansWithMount();
  void account(const ScanReport& report);
  void warnOfNoReturn(const ScanReport& report);
  void warnOfSkew(const ScanReport& report);
  void accountPoses(bool scans_were_taken);

  /// A new estimate begins at a pose; what waits is dropped, for a reason in words.
  void begin(const SE2& odom_from_base, const Eigen::Matrix3d& covariance, const std::string& reason,
             const Found& before = {});
  void followTime(Stamp jump);
  void reset();
  Services::Actions::Answer setPose(const geometry_msgs::PoseWithCovarianceStamped& message);
  void pause(bool paused);
  void keepPose();

  std::string waitingFor() const;  ///< empty if for nothing

  Options options_;
  std::mutex mutex_;                      // of all that follows
  std::vector<std::string> scan_topics_;  // of each laser
  std::string odometry_source_;
  std::unique_ptr<ScanOdometry> pipeline_;
  TfInput tf_;
  EstimatePublisher publisher_;
  SecondParent second_parent_;
  MapPublisher map_publisher_;
  DebugView debug_view_;
  ros::Publisher status_publisher_;
  Warnings warnings_;
  Health health_;
  PoseKeeper pose_keeper_;
  InputGate gate_;
  ImuInput imu_;
  PoseUpdateInput pose_updates_;
  ScansWithoutMount scans_without_mount_;
  bool paused_ = false;

  // What calls back comes last, so that it is the first to go.
  diagnostic_updater::Updater diagnostics_;
  std::vector<ros::Subscriber> subscribers_;
  ros::WallTimer view_timer_;
  std::vector<ros::WallTimer> timers_;
  Services services_;
  Reconfigure reconfigure_;
};

}  // namespace sckf
