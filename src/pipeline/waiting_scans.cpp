#include "sckf_odometry/pipeline/waiting_scans.h"

#include <algorithm>
#include <set>
#include <utility>

namespace sckf {

namespace {

bool later(Stamp stamp, const WaitingScans::Entry& entry) { return stamp < entry.scan.stamp; }

}  // namespace

void WaitingScans::add(LaserScan scan, const Eigen::Isometry3d& base_from_laser, const Sweep& sweep,
                       std::size_t laser) {
  const auto place = std::upper_bound(scans_.begin(), scans_.end(), scan.stamp, later);
  scans_.insert(place, Entry{std::move(scan), base_from_laser, sweep, laser, arrivals_++});
}

std::size_t WaitingScans::countAfter(Stamp stamp) const {
  return static_cast<std::size_t>(
      std::distance(std::upper_bound(scans_.begin(), scans_.end(), stamp, later), scans_.end()));
}

bool WaitingScans::areOfAll(std::size_t lasers) const {
  std::set<std::size_t> waiting;
  for (const Entry& entry : scans_) waiting.insert(entry.laser);
  return waiting.size() >= lasers;
}

WaitingScans::Entry WaitingScans::takeOldest() {
  Entry entry = std::move(scans_.front());
  scans_.pop_front();
  return entry;
}

WaitingScans::Entry WaitingScans::giveUp() {
  const auto arrived_earlier = [](const Entry& a, const Entry& b) { return a.arrival < b.arrival; };
  const auto longest = std::min_element(scans_.begin(), scans_.end(), arrived_earlier);
  Entry entry = std::move(*longest);
  scans_.erase(longest);
  return entry;
}

}  // namespace sckf
