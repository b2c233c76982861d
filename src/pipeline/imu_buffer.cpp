#include "sckf_odometry/pipeline/imu_buffer.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "sckf_odometry/core/se2.h"
#include "sckf_odometry/pipeline/odometry_buffer.h"
#include "sckf_odometry/pipeline/stamped.h"

namespace sckf {

namespace {

/// Readings that wait for odometry, without which none is ever used.
constexpr std::size_t kMostSamples = 20000;

/// Faster than any gyro measures [rad/s], and more than any yaw is [rad].
constexpr double kLargest = 1e3;

bool isSensible(const std::optional<double>& value) { return !value || std::abs(*value) <= kLargest; }

double rateAt(const ImuSample& before, const ImuSample& after, Stamp stamp) {
  return *before.yaw_rate + share(before, after, stamp) * (*after.yaw_rate - *before.yaw_rate);
}

}  // namespace

ImuBuffer::Insertion ImuBuffer::insert(const ImuSample& sample) {
  if (!isSensible(sample.yaw_rate) || !isSensible(sample.yaw) || !isTime(sample.stamp)) return Insertion::kNotFinite;
  if (discarded_ && sample.stamp < *discarded_) return Insertion::kTooOld;
  const auto after = firstFrom(samples_, sample.stamp);
  if (after != samples_.end() && after->stamp == sample.stamp) return Insertion::kDuplicate;
  samples_.insert(after, sample);
  if (samples_.size() > kMostSamples) samples_.pop_front();
  return Insertion::kInserted;
}

bool ImuBuffer::isGap(const ImuSample& before, const ImuSample& after) const {
  return seconds(after.stamp - before.stamp) > longest_gap_;
}

ImuBuffer::Samples::const_iterator ImuBuffer::bracket(Stamp stamp) const {
  const auto after = firstFrom(samples_, stamp);
  if (after == samples_.end() || after->stamp == stamp) return after;
  const bool told = after != samples_.begin() && !isGap(*std::prev(after), *after);
  return told ? after : samples_.end();
}

std::optional<double> ImuBuffer::rotation(Stamp from, Stamp to) const {
  auto after = bracket(from);
  if (after == samples_.end() || bracket(to) == samples_.end() || from >= to) return std::nullopt;
  if (after->stamp == from) ++after;
  double rotation = 0.0;
  for (Stamp begin = from; begin < to; ++after) {
    const auto before = std::prev(after);
    if (isGap(*before, *after) || !before->yaw_rate || !after->yaw_rate) return std::nullopt;
    const Stamp end = std::min(after->stamp, to);
    rotation += 0.5 * (rateAt(*before, *after, begin) + rateAt(*before, *after, end)) * seconds(end - begin);
    begin = end;
  }
  return rotation;
}

std::optional<double> ImuBuffer::yaw(Stamp stamp) const {
  const auto after = bracket(stamp);
  if (after == samples_.end() || !after->yaw) return std::nullopt;
  if (after->stamp == stamp) return after->yaw;
  const auto before = std::prev(after);
  if (!before->yaw) return std::nullopt;
  return wrapAngle(*before->yaw + share(*before, *after, stamp) * wrapAngle(*after->yaw - *before->yaw));
}

std::optional<double> ImuBuffer::takeYaw(Stamp stamp) {
  const std::optional<double> yaw = this->yaw(stamp);
  if (!yaw) return std::nullopt;
  const auto after = bracket(stamp);
  const Stamp oldest = after->stamp == stamp ? stamp : std::prev(after)->stamp;
  if (taken_ && oldest <= *taken_) return std::nullopt;
  taken_ = after->stamp;
  return yaw;
}

void ImuBuffer::discardBefore(Stamp stamp) {
  while (samples_.size() > 1 && samples_[1].stamp <= stamp) samples_.pop_front();
  discarded_ = stamp;
}

}  // namespace sckf
