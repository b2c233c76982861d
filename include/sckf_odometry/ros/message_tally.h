// What has become of the messages of one topic.
#pragma once

#include <ros/time.h>

#include <cstddef>
#include <map>
#include <optional>
#include <string>

namespace sckf {

/// Every message comes once and ends once, in a way that has a name. Times are ROS time.
class MessageTally {
 public:
  void came(const ros::Time& stamp, const ros::Time& now);
  void ended(const std::string& how, std::size_t count = 1);

  /// It ended so, and was of use.
  void used(const std::string& how = "used");
  /// They ended as "refused, kind". reason: value and what is expected.
  void refused(const std::string& kind, const std::string& reason, std::size_t count = 1);

  std::size_t received() const { return received_; }
  bool anyUsed() const { return used_ > 0; }
  std::size_t refusedInARow() const { return refused_in_a_row_; }   ///< since the last one that was used
  const std::string& lastRefusal() const { return last_refusal_; }  ///< its reason
  std::size_t together() const;                                     ///< that have ended
  const std::map<std::string, std::size_t>& ends() const { return ends_; }

  /// [s] since the last one came; empty before the first, or before there was a time. Zero where it has gone back.
  std::optional<double> silence(const ros::Time& now) const;

  /// Since the last call.
  struct Recent {
    double rate = 0.0;                  ///< [1/s], zero while time stands
    std::optional<double> latency;      ///< [s] from stamp to arrival, the mean; empty if none with a stamp came
    std::optional<double> latency_max;  ///< [s]
  };
  Recent recent(const ros::Time& now);

 private:
  std::size_t received_ = 0;
  std::map<std::string, std::size_t> ends_;
  std::size_t used_ = 0;
  std::size_t refused_in_a_row_ = 0;
  std::string last_refusal_;
  ros::Time last_;
  ros::Time recent_since_;
  std::size_t recent_received_ = 0;
  std::size_t recent_stamped_ = 0;
  double recent_latency_ = 0.0;  // [s], of those together
  double recent_latency_max_ = 0.0;
};

}  // namespace sckf
