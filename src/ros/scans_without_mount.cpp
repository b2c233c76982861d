#include "sckf_odometry/ros/scans_without_mount.h"

#include <utility>

#include "sckf_odometry/ros/conversions.h"

namespace sckf {

std::vector<ScansWithoutMount::Mounted> ScansWithoutMount::take(TfInput& tf) {
  std::vector<Mounted> mounted;
  std::deque<Scan> waiting;
  for (Scan& scan : waiting_) {
    if (const auto base_from_sensor = tf.baseFrom(frameName(scan.message.header.frame_id), &problem_)) {
      mounted.push_back({std::move(scan), *base_from_sensor});
    } else {
      waiting.push_back(std::move(scan));
    }
  }
  waiting_ = std::move(waiting);
  return mounted;
}

std::optional<std::size_t> ScansWithoutMount::giveUpBeyond(std::size_t most) {
  if (waiting_.size() <= most) return std::nullopt;
  const std::size_t laser = waiting_.front().laser;
  waiting_.pop_front();
  return laser;
}

}  // namespace sckf
