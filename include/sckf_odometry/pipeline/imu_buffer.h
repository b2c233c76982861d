// What an IMU says of the robot's heading, in the order of time.
#pragma once

#include <cstddef>
#include <deque>
#include <optional>

#include "sckf_odometry/matching/laser_scan.h"

namespace sckf {

/// One reading of an IMU, turned into base_link. Empty where the IMU does not measure it.
struct ImuSample {
  Stamp stamp{0};
  std::optional<double> yaw_rate;  ///< of base_link [rad/s], with the bias of the gyro
  std::optional<double> yaw;       ///< of base_link in the IMU's own world, whose zero may be anywhere [rad]
};

/// Keeps what is needed to tell rotations and headings after the last instant asked for, as far as readings follow each
/// other without a gap.
class ImuBuffer {
 public:
  enum class Insertion {
    kInserted,
    kDuplicate,  ///< there is a reading of this stamp already
    kTooOld,     ///< older than what has been used
    kNotFinite,  ///< a value is no number, or larger than any can be, or its stamp no time
  };

  /// longest_gap: [s] nothing is interpolated between readings that are farther apart.
  explicit ImuBuffer(double longest_gap) : longest_gap_(longest_gap) {}

  /// Readings may come in any order, but not before the instant up to which they have been forgotten.
  Insertion insert(const ImuSample& sample);

  bool empty() const { return samples_.empty(); }
  std::size_t size() const { return samples_.size(); }
  Stamp newest() const { return samples_.back().stamp; }

  /// The integral of the yaw rate [rad] from one instant to a later one; empty unless it is measured all the time.
  std::optional<double> rotation(Stamp from, Stamp to) const;

  /// The yaw at an instant [rad], interpolated; empty unless readings on both sides tell it.
  std::optional<double> yaw(Stamp stamp) const;

  /// As yaw(), but each reading tells its yaw once: empty if one of those on both sides has been taken before.
  std::optional<double> takeYaw(Stamp stamp);

  /// All readings may be taken once more.
  void forgetTaken() { taken_.reset(); }

  /// Forgets what lies before the reading that brackets the instant.
  void discardBefore(Stamp stamp);

 private:
  using Samples = std::deque<ImuSample>;

  /// The reading at or after an instant that lies between two readings without a gap; end if it does not.
  Samples::const_iterator bracket(Stamp stamp) const;
  bool isGap(const ImuSample& before, const ImuSample& after) const;

  double longest_gap_;  // [s]
  Samples samples_;     // sorted by stamp, no two equal
  std::optional<Stamp> discarded_;
  std::optional<Stamp> taken_;  // the newest reading whose yaw has been taken
};

}  // namespace sckf
