#include "sckf_odometry/pipeline/odometry_buffer.h"

#include <algorithm>

namespace sckf {

namespace {

bool earlier(const OdometrySample& sample, Stamp stamp) { return sample.stamp < stamp; }

}  // namespace

OdometryBuffer::Insertion OdometryBuffer::insert(const OdometrySample& sample) {
  if (!sample.odom_from_base.vector().allFinite()) return Insertion::kNotFinite;
  if (discarded_ && sample.stamp < *discarded_) return Insertion::kTooOld;
  const auto place = std::lower_bound(samples_.begin(), samples_.end(), sample.stamp, earlier);
  if (place != samples_.end() && place->stamp == sample.stamp) return Insertion::kDuplicate;
  samples_.insert(place, sample);
  return Insertion::kInserted;
}

OdometrySample OdometryBuffer::at(Stamp stamp) const {
  const auto after = std::lower_bound(samples_.begin(), samples_.end(), stamp, earlier);
  if (after->stamp == stamp) return *after;
  const auto before = std::prev(after);
  const double share = seconds(stamp - before->stamp) / seconds(after->stamp - before->stamp);
  const Eigen::Vector3d motion = between(before->odom_from_base, after->odom_from_base).vector();
  OdometrySample sample = *after;  // a twist covariance holds for the interval that ends at its sample
  sample.stamp = stamp;
  sample.odom_from_base = compose(before->odom_from_base, SE2(share * motion));
  return sample;
}

Stamp OdometryBuffer::lastUpTo(Stamp stamp) const {
  const auto later = [](Stamp instant, const OdometrySample& sample) { return instant < sample.stamp; };
  return std::prev(std::upper_bound(samples_.begin(), samples_.end(), stamp, later))->stamp;
}

std::vector<OdometryBuffer::Step> OdometryBuffer::steps(Stamp from, Stamp to) const {
  std::vector<Step> steps;
  if (from >= to) return steps;
  OdometrySample last = at(from);
  const auto append = [&steps, &last](const OdometrySample& next) {
    steps.push_back({last, next});
    last = next;
  };
  const auto later = [](Stamp stamp, const OdometrySample& sample) { return stamp < sample.stamp; };
  for (auto it = std::upper_bound(samples_.begin(), samples_.end(), from, later);
       it != samples_.end() && it->stamp < to; ++it) {
    append(*it);
  }
  append(at(to));
  return steps;
}

void OdometryBuffer::discardBefore(Stamp stamp) {
  while (samples_.size() > 1 && samples_[1].stamp <= stamp) samples_.pop_front();
  discarded_ = stamp;
}

}  // namespace sckf
