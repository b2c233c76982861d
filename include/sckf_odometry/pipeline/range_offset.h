// An error that all ranges of a laser have in common.
#pragma once

#include "sckf_odometry/matching/displacement_estimation.h"

namespace sckf {

/// Laser scanners measure a centimetre or two too long or too short, always in the same way. What that bends is matched
/// with what it bends otherwise from the next place, so that each displacement turns the robot a little, in a corridor
/// always to the same side. Estimated from how scans fall together, as the mean of what matches tell and of none:
/// matches err by noise, which many of them average, and by a bias, which they do not.
class RangeOffset {
 public:
  /// std: how large it may be [m]; 0: there is none.
  explicit RangeOffset(double std) : prior_variance_(std * std) {}

  /// Of two scans to whose ranges `added` has been added [m].
  void add(const RangeOffsetEvidence& evidence, double added);

  double value() const;     ///< to be added to each range [m]
  double variance() const;  ///< [m²]

  /// Begins anew if std is another one.
  void setStd(double std);

 private:
  double errorVariance() const;  ///< of told_

  double prior_variance_;
  double information_ = 0.0;    // of what has been told, without its bias
  double told_ = 0.0;           // the mean of it
  double bias_variance_ = 0.0;  // the mean of it
};

}  // namespace sckf
