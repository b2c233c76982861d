// What is always the same about a laser and nobody tells.
#pragma once

#include "sckf_odometry/matching/scan_matcher.h"

namespace sckf {

/// A constant of a laser, estimated from how its scans fall together, as the mean of what matches tell and of none:
/// matches err by noise, which many of them average, and by a bias, which they do not.
class LaserConstant {
 public:
  /// std: how large it may be; 0: there is none.
  explicit LaserConstant(double std = 0.0) : prior_variance_(std * std) {}

  /// Of two scans for which `allowed_for` of it has been undone.
  void add(const ConstantEvidence& evidence, double allowed_for);

  double value() const;
  double variance() const;

  /// Begins anew if std is another one.
  void setStd(double std);

 private:
  double errorVariance() const;  ///< of told_

  double prior_variance_;
  double information_ = 0.0;    // of what has been told, without its bias
  double told_ = 0.0;           // the mean of it
  double bias_variance_ = 0.0;  // the mean of it
};

struct LaserConstants {
  /// Laser scanners measure a centimetre or two too long or too short, always in the same way: to be added to each
  /// range [m]. What that bends is matched with what it bends otherwise from the next place, so that each displacement
  /// turns the robot a little, in a corridor always to the same side.
  LaserConstant range_offset;

  /// From the first beam of a scan to the last [s], below 0 where the last is measured first. While the laser sweeps
  /// the robot drives on, which turns a wall ahead of it, the more the nearer the wall: each displacement turns the
  /// robot a little, always to the same side.
  LaserConstant sweep_duration;

  /// From a match of the scan that has been believed.
  void learn(const Match& match, const PreparedScan& scan);
};

}  // namespace sckf
