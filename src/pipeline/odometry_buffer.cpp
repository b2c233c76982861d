#include "sckf_odometry/pipeline/odometry_buffer.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "sckf_odometry/pipeline/stamped.h"

namespace sckf {

namespace {

/// A driver that begins anew says that the robot is at the origin of its frame.
bool isAtOrigin(const SE2& pose) {
  constexpr double kNear = 0.1;  // [m, rad] a robot may have moved on by this
  return pose.translation().norm() < kNear && std::abs(pose.yaw) < kNear;
}

}  // namespace

bool isTime(Stamp stamp) { return stamp >= Stamp(0) && stamp <= std::chrono::seconds(4294967296); }

void OdometryBuffer::setLimits(const MotionLimits& limits, double timeout) {
  limits_ = limits;
  timeout_ = timeout;
}

OdometryBuffer::Insertion OdometryBuffer::insert(const OdometrySample& sample, const MotionGuess& guess) {
  if (!sample.odom_from_base.vector().allFinite() || !isTime(sample.stamp)) return Insertion::kNotFinite;
  if (discarded_ && sample.stamp < *discarded_) return Insertion::kTooOld;
  if (!isAhead(sample)) {
    ahead_.reset();  // its stamp was wrong
    return place(sample, guess);
  }
  if (ahead_ && sample.stamp == ahead_->stamp) return Insertion::kDuplicate;
  const bool confirmed = ahead_ && seconds(ahead_->stamp - sample.stamp) <= timeout_;
  if (!confirmed) {
    ahead_ = sample;
    return Insertion::kAhead;
  }
  place(*ahead_, guess);
  ahead_.reset();
  return place(sample, guess);
}

bool OdometryBuffer::isAhead(const OdometrySample& sample) const {
  return !empty() && seconds(sample.stamp - newest()) > timeout_;
}

OdometryBuffer::Insertion OdometryBuffer::place(const OdometrySample& sample, const MotionGuess& guess) {
  const auto after = firstFrom(samples_, sample.stamp);
  if (after != samples_.end() && after->stamp == sample.stamp) return Insertion::kDuplicate;
  const auto entry = samples_.insert(after, Entry{sample, std::nullopt, false});
  judge(entry, guess);
  judge(std::next(entry), guess);
  return Insertion::kInserted;
}

void OdometryBuffer::judge(const Entries::iterator& entry, const MotionGuess& guess) {
  if (entry == samples_.begin() || entry == samples_.end() || entry->bridged) return;
  const Entry& before = *std::prev(entry);
  if (entry->guess) --jumps_;
  if (isKnownMotion(before, *entry)) {
    entry->guess.reset();
    return;
  }
  if (!entry->guess) entry->guess = guess;
  entry->guess->since = std::min(entry->guess->since, before.stamp);
  ++jumps_;
}

bool OdometryBuffer::isKnownMotion(const Entry& before, const Entry& after) const {
  if (before.bridged) return false;
  const SE2& origin_from_before = before.odom_from_base;
  const double dt = seconds(after.stamp - before.stamp);
  if (!isPossible(between(origin_from_before, after.odom_from_base), dt, limits_)) return false;
  const bool was_away = !isPossible(origin_from_before, 0.0, limits_);
  return dt <= timeout_ || !was_away || !isAtOrigin(after.odom_from_base);
}

void OdometryBuffer::bridge(Stamp stamp, const MotionGuess& guess) {
  Entry entry = empty() ? Entry() : samples_.back();
  entry.stamp = stamp;
  entry.twist_covariance.reset();
  entry.guess = guess;
  entry.guess->since = std::min(guess.since, empty() ? stamp : newest());
  entry.bridged = true;
  samples_.push_back(entry);
  if (ahead_ && ahead_->stamp <= stamp) ahead_.reset();
}

OdometryBuffer::Entry OdometryBuffer::at(Stamp stamp) const {
  assert(covers(stamp));
  const auto after = firstFrom(samples_, stamp);
  if (after->stamp == stamp) return *after;
  const auto before = std::prev(after);
  Entry entry = *after;  // twist covariance and guess hold for the interval that ends at their sample
  entry.stamp = stamp;
  entry.odom_from_base = poseBetween(*before, *after, stamp);
  return entry;
}

Stamp OdometryBuffer::lastUpTo(Stamp stamp) const { return std::prev(firstAfter(samples_, stamp))->stamp; }

std::vector<OdometryBuffer::Step> OdometryBuffer::steps(Stamp from, Stamp to) const {
  std::vector<Step> steps;
  if (from >= to) return steps;
  OdometrySample last = at(from);
  auto after = firstAfter(samples_, from);
  const auto append = [&](const Entry& next) {
    steps.push_back({last, next, next.guess, seconds(after->stamp - std::prev(after)->stamp)});
    last = next;
  };
  for (; after->stamp < to; ++after) append(*after);
  append(at(to));
  return steps;
}

void OdometryBuffer::discardBefore(Stamp stamp) {
  while (samples_.size() > 1 && samples_[1].stamp <= stamp) samples_.pop_front();
  discarded_ = stamp;
}

}  // namespace sckf
