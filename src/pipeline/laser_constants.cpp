#include "sckf_odometry/pipeline/laser_constants.h"

#include <algorithm>
#include <cmath>

namespace sckf {

void LaserConstant::add(const ConstantEvidence& evidence, double allowed_for) {
  // Matches one after the other see the same walls, and those are not as straight as they are taken for.
  constexpr double kMatchesForOne = 30.0;
  constexpr double kFarthest = 3.0;  // std: no single match tells of more
  if (!(evidence.information > 0.0) || prior_variance_ == 0.0) return;
  const double information = evidence.information / kMatchesForOne;
  const double bias_variance = evidence.bias_std * evidence.bias_std;
  const double bound = kFarthest * std::sqrt(variance() + bias_variance + 1.0 / information);
  const double told = allowed_for + std::clamp(evidence.value, -bound, bound);
  information_ += information;
  const double share = information / information_;
  told_ += share * (told - told_);
  bias_variance_ += share * (bias_variance - bias_variance_);
}

double LaserConstant::errorVariance() const { return bias_variance_ + 1.0 / information_; }

double LaserConstant::value() const {
  if (information_ == 0.0) return 0.0;
  return told_ * prior_variance_ / (prior_variance_ + errorVariance());
}

double LaserConstant::variance() const {
  if (information_ == 0.0) return prior_variance_;
  return prior_variance_ * errorVariance() / (prior_variance_ + errorVariance());
}

void LaserConstant::setStd(double std) {
  if (std * std != prior_variance_) *this = LaserConstant(std);
}

void LaserConstants::learn(const Match& match, const PreparedScan& scan) {
  range_offset.add(match.range_offset, scan.range_offset);
  sweep_duration.add(match.sweep_duration, scan.sweep.duration);
}

}  // namespace sckf
