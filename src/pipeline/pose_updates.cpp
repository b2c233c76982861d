#include "sckf_odometry/pipeline/pose_updates.h"

#include <iterator>

#include "sckf_odometry/pipeline/stamped.h"

namespace sckf {

namespace {

constexpr std::size_t kMostWaiting = 1000;  // poses that wait for odometry

}  // namespace

PoseReport notUsed(Stamp stamp, PoseOutcome outcome, const std::string& reason) {
  PoseReport report;
  report.stamp = stamp;
  report.outcome = outcome;
  report.reason = reason;
  return report;
}

std::optional<PoseUpdate> WaitingPoses::add(const PoseUpdate& pose) {
  poses_.insert(firstAfter(poses_, pose.stamp), pose);
  if (poses_.size() <= kMostWaiting) return std::nullopt;
  const PoseUpdate given_up = poses_.front();
  poses_.pop_front();
  return given_up;
}

std::optional<PoseUpdate> WaitingPoses::takeUpTo(Stamp stamp) {
  if (poses_.empty() || poses_.front().stamp > stamp) return std::nullopt;
  const PoseUpdate pose = poses_.front();
  poses_.pop_front();
  return pose;
}

void Trail::add(Stamp stamp, const SE2& odom_from_base, double duration) {
  if (!poses_.empty() && poses_.back().stamp == stamp) poses_.pop_back();
  poses_.push_back({stamp, odom_from_base});
  while (poses_.size() > 1 && poses_[1].stamp + toDuration(duration) < stamp) poses_.pop_front();
}

void Trail::move(const SE2& by) {
  for (Entry& entry : poses_) entry.odom_from_base = compose(by, entry.odom_from_base);
}

std::optional<SE2> Trail::at(Stamp stamp) const {
  const auto after = firstFrom(poses_, stamp);
  if (after == poses_.end()) return std::nullopt;
  if (after->stamp == stamp) return after->odom_from_base;
  if (after == poses_.begin()) return std::nullopt;
  return poseBetween(*std::prev(after), *after, stamp);
}

}  // namespace sckf
