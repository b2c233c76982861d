#include "sckf_odometry/pipeline/pose_updates.h"

#include <algorithm>
#include <iterator>

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
  const auto later = [](Stamp stamp, const PoseUpdate& other) { return stamp < other.stamp; };
  poses_.insert(std::upper_bound(poses_.begin(), poses_.end(), pose.stamp, later), pose);
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

std::optional<SE2> Trail::at(Stamp stamp) const {
  const auto earlier = [](const Entry& entry, Stamp instant) { return entry.stamp < instant; };
  const auto after = std::lower_bound(poses_.begin(), poses_.end(), stamp, earlier);
  if (after == poses_.end()) return std::nullopt;
  if (after->stamp == stamp) return after->odom_from_base;
  if (after == poses_.begin()) return std::nullopt;
  const auto before = std::prev(after);
  const double share = seconds(stamp - before->stamp) / seconds(after->stamp - before->stamp);
  const Eigen::Vector3d motion = between(before->odom_from_base, after->odom_from_base).vector();
  return compose(before->odom_from_base, SE2(share * motion));
}

}  // namespace sckf
