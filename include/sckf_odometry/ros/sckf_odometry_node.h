// The node: messages in, the pipeline, messages out. The nodelet and the standalone node are this class.
#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <nav_msgs/Odometry.h>
#include <ros/message_event.h>
#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <ros/wall_timer.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_msgs/TFMessage.h>

#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "sckf_odometry/pipeline/scan_odometry.h"
#include "sckf_odometry/ros/debug_view.h"
#include "sckf_odometry/ros/estimate_publisher.h"
#include "sckf_odometry/ros/parameters.h"
#include "sckf_odometry/ros/tf_input.h"
#include "sckf_odometry/ros/warnings.h"

namespace sckf {

/// Subscribes to scan and odom (nav_msgs/Odometry) or TF, publishes what EstimatePublisher says and diagnostics.
/// Its callbacks may come from any number of threads.
class ScKfOdometryNode {
 public:
  /// Throws std::invalid_argument if a parameter is bad: parameter, value, what is allowed.
  ScKfOdometryNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh);

 private:
  /// Counted for the diagnostics, so that every message is accounted for.
  struct Counts {
    std::map<ScanOutcome, std::size_t> scans;
    std::size_t scans_refused = 0;  ///< by this layer: no stamp, no frame, no mount
    std::size_t odometry = 0;
    std::size_t odometry_refused = 0;
    std::size_t scans_timed = 0;
    double scan_time = 0.0;      ///< [s], of those together
    double scan_time_max = 0.0;  ///< [s], of one
  };

  void subscribe(ros::NodeHandle& nh);
  void startTimers(ros::NodeHandle& nh);

  void onScan(const sensor_msgs::LaserScan::ConstPtr& message);
  void onOdometry(const nav_msgs::Odometry::ConstPtr& message);
  void onTransforms(const ros::MessageEvent<const tf2_msgs::TFMessage>& event, bool is_static);
  void onViewTimer(const ros::WallTimerEvent& event);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  /// Runs a callback: one at a time, and nothing that it throws gets into the process that others live in too.
  template <typename Callback>
  void guarded(const Callback& callback);

  void addOdometry(const OdometrySample& sample);
  /// Whether the sample's stamp is so far from the others that the next ones have to tell whether time has jumped or
  /// one stamp is wrong.
  bool isHeldBack(const OdometrySample& sample);
  void acceptHeldBack();
  void restart();
  void refuseScan(const std::string& reason);
  void refuseOdometry(const std::string& reason);

  /// Everything that has become possible with the message that just came.
  void advance();
  void passScansWithMount();
  void account(const ScanReport& report);
  void warnOfSecondParent(const ros::MessageEvent<const tf2_msgs::TFMessage>& event);
  std::string waitingFor() const;  ///< empty if for nothing

  Options options_;
  std::mutex mutex_;  // of all that follows
  std::unique_ptr<ScanOdometry> pipeline_;
  TfInput tf_;
  EstimatePublisher publisher_;
  DebugView debug_view_;
  Warnings warnings_;
  Counts counts_;
  std::deque<sensor_msgs::LaserScan::ConstPtr> scans_without_mount_;
  std::vector<OdometrySample> held_back_;
  Stamp newest_odometry_{0};
  std::string mount_problem_;  // of the newest scan that waits for its mount
  std::string last_scan_;      // what became of it

  diagnostic_updater::Updater diagnostics_;
  std::string scan_topic_;
  std::string odometry_topic_;
  std::vector<ros::Subscriber> subscribers_;  // with the timers the last, so that they are the first to go
  ros::WallTimer view_timer_;
  ros::WallTimer diagnostic_timer_;
};

}  // namespace sckf
