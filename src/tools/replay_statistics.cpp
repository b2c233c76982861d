#include "sckf_odometry/tools/replay_statistics.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace sckf {

namespace {

void printConstant(const char* what, const LaserConstant& constant, const char* unit) {
  if (constant.variance() == 0.0) return;
  std::printf("%s %.4f +- %.4f %s\n", what, constant.value(), std::sqrt(constant.variance()), unit);
}

void printTimes(const char* what, std::vector<double> times) {
  if (times.empty()) return;
  std::sort(times.begin(), times.end());
  const auto quantile = [&times](double q) {
    return 1e3 * times[static_cast<std::size_t>(q * static_cast<double>(times.size() - 1))];
  };
  std::printf("%s: median %.3f ms, 95 %% below %.3f ms, longest %.3f ms\n", what, quantile(0.5), quantile(0.95),
              quantile(1.0));
}

}  // namespace

void ReplayStatistics::add(const ScanReport& report, double time) {
  ++outcomes_[report.outcome];
  ++deskewing_[report.deskewing];
  times_.push_back(time);
  if (report.new_reference) reference_times_.push_back(time);
  older_references_ += static_cast<std::size_t>(report.older_references);
  landmarks_used_ += static_cast<std::size_t>(report.landmarks_used);
  constants_ = report.laser_constants;
  no_return_ = std::min(no_return_, report.no_return.value());
  most_landmarks_ = std::max(most_landmarks_, report.landmarks.size());
}

void ReplayStatistics::print(double log_duration, double wall_time) const {
  std::printf("%zu scans", times_.size());
  for (const auto& [outcome, count] : outcomes_) std::printf(", %zu %s", count, toString(outcome).c_str());
  for (const auto& [deskewing, count] : deskewing_) {
    if (deskewing != Deskewing::kOff) std::printf(", %zu %s", count, toString(deskewing).c_str());
  }
  std::printf("\n");
  if (times_.empty()) return;
  if (most_landmarks_ > 0) {
    std::printf("landmarks seen %zu times, at most %zu in the state\n", landmarks_used_, most_landmarks_);
  }
  if (older_references_ > 0) {
    std::printf("older references used %zu times, by %zu scans that became one\n", older_references_,
                reference_times_.size());
  }
  if (std::isfinite(no_return_)) {
    std::printf("no return: readings of %g m and more, although range_max is larger\n", no_return_);
  }
  printConstant("range offset", constants_.range_offset, "m");
  printConstant("sweep duration", constants_.sweep_duration, "s");
  printTimes("time of a scan", times_);
  printTimes("time of a scan that became a reference", reference_times_);
  std::printf("%.1f s of log in %.2f s: %.0f times real time\n", log_duration, wall_time, log_duration / wall_time);
}

}  // namespace sckf
