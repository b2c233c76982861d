#include "sckf_odometry/pipeline/range_offset.h"

#include <algorithm>
#include <cmath>

namespace sckf {

void RangeOffset::add(const RangeOffsetEvidence& evidence, double added) {
  // Matches one after the other see the same walls, and those are not as straight as they are taken for.
  constexpr double kMatchesForOne = 30.0;
  constexpr double kFarthest = 3.0;  // std: no single match tells of more
  if (!(evidence.information > 0.0) || prior_variance_ == 0.0) return;
  const double information = evidence.information / kMatchesForOne;
  const double bias_variance = evidence.bias_std * evidence.bias_std;
  const double bound = kFarthest * std::sqrt(variance() + bias_variance + 1.0 / information);
  const double told = added + std::clamp(evidence.value, -bound, bound);
  information_ += information;
  const double share = information / information_;
  told_ += share * (told - told_);
  bias_variance_ += share * (bias_variance - bias_variance_);
}

double RangeOffset::errorVariance() const { return bias_variance_ + 1.0 / information_; }

double RangeOffset::value() const {
  if (information_ == 0.0) return 0.0;
  return told_ * prior_variance_ / (prior_variance_ + errorVariance());
}

double RangeOffset::variance() const {
  if (information_ == 0.0) return prior_variance_;
  return prior_variance_ * errorVariance() / (prior_variance_ + errorVariance());
}

void RangeOffset::setStd(double std) {
  if (std * std != prior_variance_) *this = RangeOffset(std);
}

}  // namespace sckf
