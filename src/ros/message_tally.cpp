#include "sckf_odometry/ros/message_tally.h"

#include <algorithm>

namespace sckf {

void MessageTally::came(const ros::Time& stamp, const ros::Time& now) {
  ++received_;
  last_ = now;
  ++recent_received_;
  if (stamp.isZero() || now.isZero()) return;
  const double latency = now.toSec() - stamp.toSec();
  recent_latency_ += latency;
  recent_latency_max_ = recent_stamped_ == 0 ? latency : std::max(recent_latency_max_, latency);
  ++recent_stamped_;
}

void MessageTally::ended(const std::string& how, std::size_t count) {
  if (count > 0) ends_[how] += count;
}

void MessageTally::used(const std::string& how) {
  ended(how);
  ++used_;
  refused_in_a_row_ = 0;
}

void MessageTally::refused(const std::string& kind, const std::string& reason, std::size_t count) {
  if (count == 0) return;
  ended("refused, " + kind, count);
  refused_in_a_row_ += count;
  last_refusal_ = reason;
}

std::size_t MessageTally::together() const {
  std::size_t sum = 0;
  for (const auto& [how, count] : ends_) sum += count;
  return sum;
}

std::optional<double> MessageTally::silence(const ros::Time& now) const {
  if (last_.isZero()) return std::nullopt;
  return std::max(0.0, now.toSec() - last_.toSec());
}

MessageTally::Recent MessageTally::recent(const ros::Time& now) {
  Recent recent;
  const double duration = now.toSec() - recent_since_.toSec();
  if (!recent_since_.isZero() && duration > 0.0) recent.rate = static_cast<double>(recent_received_) / duration;
  if (recent_stamped_ > 0) {
    recent.latency = recent_latency_ / static_cast<double>(recent_stamped_);
    recent.latency_max = recent_latency_max_;
  }
  recent_since_ = now;
  recent_received_ = recent_stamped_ = 0;
  recent_latency_ = 0.0;
  return recent;
}

}  // namespace sckf
