// Scans that wait for odometry at their stamps.
#pragma once

#include <Eigen/Geometry>
#include <deque>

#include "sckf_odometry/pipeline/sweep.h"

namespace sckf {

/// Sorted by stamp; of equal stamps the first to come is the first.
class WaitingScans {
 public:
  struct Entry {
    LaserScan scan;
    Eigen::Isometry3d base_from_laser;
    Sweep sweep;
    std::size_t laser = 0;
    std::size_t arrival = 0;

    Stamp end() const { return scan.stamp + sweep.duration; }  ///< until when odometry is asked for
  };

  void add(LaserScan scan, const Eigen::Isometry3d& base_from_laser, const Sweep& sweep = {}, std::size_t laser = 0);

  bool empty() const { return scans_.empty(); }
  std::size_t size() const { return scans_.size(); }
  Stamp oldest() const { return scans_.front().scan.stamp; }
  Stamp newest() const { return scans_.back().scan.stamp; }
  Stamp endOfOldest() const { return scans_.front().end(); }
  std::size_t countAfter(Stamp stamp) const;

  /// Whether scans of all lasers but that of the oldest wait: none that is still to come should be older than it.
  bool areOfAll(std::size_t lasers) const;

  Entry takeOldest();

  /// Drops the scan that has waited longest, which is not the oldest if its stamp is wrong. Returns it.
  Entry giveUp();

 private:
  std::deque<Entry> scans_;
  std::size_t arrivals_ = 0;
};

}  // namespace sckf
