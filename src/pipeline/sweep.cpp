#include "sckf_odometry/pipeline/sweep.h"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace sckf {

namespace {

/// No laser that a robot drives with is slower [s].
constexpr double kLongest = 1.0;

/// The longest of so many gaps between scans is taken for their distance: stamps come in bursts, and scans get lost.
constexpr std::size_t kGaps = 5;

/// Stamps jitter: by this a sweep may be longer than scans are apart.
constexpr double kTolerance = 1.1;

Sweep refused(const std::string& problem) { return {Deskewing::kRefused, Stamp(0), problem}; }

}  // namespace

std::string toString(Deskewing deskewing) {
  switch (deskewing) {
    case Deskewing::kOff:
      return "off";
    case Deskewing::kDone:
      return "deskewed";
    case Deskewing::kNotTold:
      return "not deskewed, no time_increment";
    case Deskewing::kRefused:
      return "not deskewed, wrong time_increment";
  }
  return "unknown";
}

Sweep SweepCheck::check(const LaserScan& scan) {
  note(scan.stamp);
  if (scan.ranges.size() < 2) return {};
  std::ostringstream text;
  text << "time_increment is " << scan.time_increment << " s";
  if (scan.time_increment == 0.0) {
    return {Deskewing::kNotTold, Stamp(0), text.str() + ": the time from one beam to the next expected"};
  }
  if (!std::isfinite(scan.time_increment) || scan.time_increment < 0.0) {
    return refused(text.str() + ": a finite time above 0 expected");
  }
  const double duration = static_cast<double>(scan.ranges.size() - 1) * scan.time_increment;
  text << ", which makes " << duration << " s of " << scan.ranges.size() << " beams: ";
  if (duration > kLongest) {
    text << "at most " << kLongest << " s expected";
    return refused(text.str());
  }
  const Stamp apart = gaps_.empty() ? Stamp::max() : *std::max_element(gaps_.begin(), gaps_.end());
  if (duration > kTolerance * seconds(apart)) {
    text << "at most the " << seconds(apart) << " s from scan to scan expected";
    return refused(text.str());
  }
  return {Deskewing::kDone, toDuration(duration), ""};
}

void SweepCheck::note(Stamp stamp) {
  const Stamp gap = std::max(stamp, last_) - std::min(stamp, last_);
  if (last_ != Stamp(0) && gap != Stamp(0)) gaps_.push_back(gap);
  if (gaps_.size() > kGaps) gaps_.pop_front();
  last_ = stamp;
}

}  // namespace sckf
