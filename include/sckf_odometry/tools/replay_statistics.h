// What replay says at its end.
#pragma once

#include <cstddef>
#include <map>
#include <vector>

#include "sckf_odometry/pipeline/scan_report.h"

namespace sckf {

/// What became of the scans, and how long they took.
class ReplayStatistics {
 public:
  /// time: [s] that the scan took.
  void add(const ScanReport& report, double time);

  /// To stdout. log_duration, wall_time: [s].
  void print(double log_duration, double wall_time) const;

 private:
  std::map<ScanOutcome, std::size_t> outcomes_;
  std::map<Deskewing, std::size_t> deskewing_;
  std::size_t older_references_ = 0;
  LaserConstants constants_;               // of the last scan's laser
  double no_return_ = NoReturn().value();  // [m] the least that was taken for one
  std::size_t landmarks_used_ = 0;
  std::size_t most_landmarks_ = 0;
  std::vector<double> times_;            // [s] of each scan …
  std::vector<double> reference_times_;  // [s] … and of those that became a reference
};

}  // namespace sckf
