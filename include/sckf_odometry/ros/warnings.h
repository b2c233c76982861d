// Warnings that say everything once and do not flood the log.
#pragma once

#include <ros/console.h>
#include <ros/time.h>

#include <map>
#include <string>

namespace sckf {

/// Each kind of warning is written at most once in a period of wall time, however fast a bag is replayed.
class Warnings {
 public:
  explicit Warnings(double period = 5.0) : period_(period) {}

  void warn(const std::string& kind, const std::string& text) {
    if (isDue(kind)) ROS_WARN_STREAM_NAMED("sckf_odometry", text);
  }

  /// For what stays as it is.
  void warnOnce(const std::string& kind, const std::string& text) {
    if (last_.count(kind) == 0) warn(kind, text);
  }

  void error(const std::string& kind, const std::string& text) {
    if (isDue(kind)) ROS_ERROR_STREAM_NAMED("sckf_odometry", text);
  }

 private:
  bool isDue(const std::string& kind) {
    const ros::SteadyTime now = ros::SteadyTime::now();
    const auto last = last_.find(kind);
    if (last != last_.end() && (now - last->second).toSec() < period_) return false;
    last_[kind] = now;
    return true;
  }

  double period_;  // [s]
  std::map<std::string, ros::SteadyTime> last_;
};

}  // namespace sckf
