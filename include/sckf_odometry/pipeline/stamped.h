// Sequences of samples in the order of their stamps.
#pragma once

#include <algorithm>

#include "sckf_odometry/core/se2.h"
#include "sckf_odometry/core/world_error.h"
#include "sckf_odometry/matching/laser_scan.h"

namespace sckf {

/// The first sample that is not older than an instant.
template <typename Sequence>
auto firstFrom(Sequence& samples, Stamp stamp) {
  return std::lower_bound(samples.begin(), samples.end(), stamp,
                          [](const auto& sample, Stamp instant) { return sample.stamp < instant; });
}

/// The first sample that is newer than an instant.
template <typename Sequence>
auto firstAfter(Sequence& samples, Stamp stamp) {
  return std::upper_bound(samples.begin(), samples.end(), stamp,
                          [](Stamp instant, const auto& sample) { return instant < sample.stamp; });
}

/// How much of the time from one sample to another, later one has gone by at an instant: 0 to 1.
template <typename Sample>
double share(const Sample& before, const Sample& after, Stamp stamp) {
  return seconds(stamp - before.stamp) / seconds(after.stamp - before.stamp);
}

/// The pose at an instant between two samples with a pose odom_from_base: along a circular arc.
template <typename Sample>
SE2 poseBetween(const Sample& before, const Sample& after, Stamp stamp) {
  const Eigen::Vector3d motion = world_error::logarithm(between(before.odom_from_base, after.odom_from_base));
  return compose(before.odom_from_base, world_error::exponential(share(before, after, stamp) * motion));
}

}  // namespace sckf
