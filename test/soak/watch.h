// What comes out of the package over a long time: whether it can be believed, how far it has got, how it accounts for
// the scans. Keeps counts alone.
#pragma once

#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <nav_msgs/Odometry.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <map>
#include <mutex>
#include <string>

#include "sckf_odometry/ros/conversions.h"

namespace sckf::test {

class Watch {
 public:
  Watch() : spinner_(1, &queue_) {
    nh_.setCallbackQueue(&queue_);
    odometry_ = nh_.subscribe("odometry/filtered", 0, &Watch::onOdometry, this);
    pose_ = nh_.subscribe("pose", 0, &Watch::onPose, this);
    diagnostics_ = nh_.subscribe("/diagnostics", 0, &Watch::onDiagnostics, this);
    spinner_.start();
  }

  /// Until there is an estimate for that time, and poses of so many scans; false if not within a minute.
  bool waitFor(Stamp stamp, std::size_t poses) {
    std::unique_lock<std::mutex> lock(mutex_);
    return news_.wait_for(lock, std::chrono::minutes(1), [&] { return newest_ >= stamp && poses_ >= poses; });
  }

  /// Until the diagnostics account for so many scans; false if they don't within a minute.
  bool waitForScans(std::size_t scans) {
    std::unique_lock<std::mutex> lock(mutex_);
    return news_.wait_for(lock, std::chrono::minutes(1), [&] { return accounted("together") >= scans; });
  }

  /// Scans of which the diagnostics say this: "updated", "gated", … or "together".
  std::size_t scans(const std::string& what) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return accounted(what);
  }

  /// All the numbers of scans that they tell, in one line.
  std::string allScans() {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::string text;
    for (const auto& [key, value] : said_) {
      const bool has_unit = key.find('[') != std::string::npos;
      if (key.rfind("scans: ", 0) == 0 && !has_unit) text += key.substr(7) + " " + value + ", ";
    }
    return text;
  }

  std::size_t poses() { return locked(poses_); }
  std::size_t bad() { return locked(bad_); }  ///< messages not finite, with a negative variance, or not newer
  SE2 pose() { return locked(newest_pose_); }

 private:
  template <typename Value>
  Value locked(const Value& value) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return value;
  }

  std::size_t accounted(const std::string& what) const {
    const auto found = said_.find("scans: " + what);
    return found == said_.end() ? 0 : std::stoul(found->second);
  }

  static bool believable(const geometry_msgs::PoseWithCovariance& pose) {
    std::string problem;
    const auto& covariance = pose.covariance;
    const bool finite = std::all_of(covariance.begin(), covariance.end(), [](double c) { return std::isfinite(c); });
    return toPlanar(pose.pose, &problem) && finite && covariance[0] >= 0 && covariance[7] >= 0 && covariance[35] >= 0;
  }

  void onOdometry(const nav_msgs::Odometry::ConstPtr& message) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const Stamp stamp = toStamp(message->header.stamp);
    if (stamp <= newest_ || !believable(message->pose)) ++bad_;
    newest_ = std::max(newest_, stamp);
    std::string problem;
    if (const auto pose = toPlanar(message->pose.pose, &problem)) newest_pose_ = *pose;
    news_.notify_all();
  }

  void onPose(const geometry_msgs::PoseWithCovarianceStamped::ConstPtr& message) {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++poses_;
    if (!believable(message->pose)) ++bad_;
    news_.notify_all();
  }

  void onDiagnostics(const diagnostic_msgs::DiagnosticArray::ConstPtr& message) {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const auto& status : message->status) {
      for (const auto& entry : status.values) said_[entry.key] = entry.value;
    }
    news_.notify_all();
  }

  std::mutex mutex_;  // of all that follows, up to the queue
  std::condition_variable news_;
  Stamp newest_{0};
  SE2 newest_pose_;
  std::size_t poses_ = 0;
  std::size_t bad_ = 0;
  std::map<std::string, std::string> said_;  // by the diagnostics, the latest

  ros::CallbackQueue queue_;
  ros::NodeHandle nh_;
  ros::Subscriber odometry_, pose_, diagnostics_;
  ros::AsyncSpinner spinner_;  // the first to go
};

}  // namespace sckf::test
