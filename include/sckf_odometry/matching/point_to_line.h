#pragma once
#include <optional>
#include <vector>

#include "sckf_odometry/core/displacement.h"
#include "sckf_odometry/matching/scan_matcher.h"
namespace sckf {
class PointToLine {
 public:
  PointToLine(const PreparedScan& reference, const PreparedScan& current) : ref_(reference), cur_(current) {}
  void setPairs(const std::vector<Pair>& candidates, const SE2& x, const MatcherOptions& o);
  const std::vector<Pair>& pairs() const { return pairs_; }
  SE2 step(const SE2& x, const Eigen::Matrix3d* prior, const SE2& prior_mean) const;
  std::optional<Displacement> solve(const SE2& x, const MatcherOptions& o);
  double residualRms() const { return rms_; }
  double cost(const SE2& x) const;

 private:
  const PreparedScan& ref_;
  const PreparedScan& cur_;
  std::vector<Pair> pairs_;
  std::vector<double> inv_std_;
  double huber_ = 2.0;
  double rms_ = 0.0;
};
}  // namespace sckf
