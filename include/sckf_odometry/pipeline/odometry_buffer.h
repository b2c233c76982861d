// Wheel odometry in the order of time, interpolated where a scan was taken.
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "sckf_odometry/core/odometry_model.h"
#include "sckf_odometry/matching/laser_scan.h"

namespace sckf {

/// One reading of the wheels.
struct OdometrySample {
  Stamp stamp{0};
  SE2 odom_from_base;                               ///< in the driver's own odometry frame
  std::optional<Eigen::Matrix3d> twist_covariance;  ///< of (vx, vy, yaw rate) in base_link, if the driver states one
};

/// Keeps what is needed to tell the motion between any two instants after the last one asked for.
class OdometryBuffer {
 public:
  enum class Insertion {
    kInserted,
    kDuplicate,  ///< there is a sample of this stamp already
    kTooOld,     ///< increments up to a later instant have been taken
    kNotFinite,  ///< its pose is no pose
  };

  /// Samples may come in any order, but not before the instant up to which increments have been taken.
  Insertion insert(const OdometrySample& sample);

  bool empty() const { return samples_.empty(); }
  Stamp oldest() const { return samples_.front().stamp; }
  Stamp newest() const { return samples_.back().stamp; }
  const OdometrySample& newestSample() const { return samples_.back(); }
  bool covers(Stamp stamp) const { return !empty() && oldest() <= stamp && stamp <= newest(); }

  /// The stamp of the newest sample that is not newer than an instant, which must not be older than the oldest.
  Stamp lastUpTo(Stamp stamp) const;

  struct Step {
    OdometrySample from;
    OdometrySample to;
  };

  /// The motion between two instants that the buffer covers, in steps from sample to sample; the ends interpolated.
  std::vector<Step> steps(Stamp from, Stamp to) const;

  /// Forgets what lies before the sample that brackets the instant.
  void discardBefore(Stamp stamp);
  void clear() { samples_.clear(); }

 private:
  OdometrySample at(Stamp stamp) const;

  std::deque<OdometrySample> samples_;  // sorted by stamp, no two equal
  std::optional<Stamp> discarded_;
};

}  // namespace sckf
