// Wheel odometry in the order of time, interpolated where a scan was taken.
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "sckf_odometry/pipeline/unknown_motion.h"

namespace sckf {

/// One reading of the wheels.
struct OdometrySample {
  Stamp stamp{0};
  SE2 odom_from_base;                               ///< in the driver's own odometry frame
  std::optional<Eigen::Matrix3d> twist_covariance;  ///< of (vx, vy, yaw rate) in base_link, if the driver states one
};

/// Whether a stamp is a time that robots live in: from 1970 to 2106, as far as stamps of ROS go.
bool isTime(Stamp stamp);

/// Keeps what is needed to tell the motion between any two instants after the last one asked for.
///
/// The step that ends at a sample is known motion, or it is not: beyond what wheels can do, back to the origin of the
/// driver's frame after a silence, or from an instant that has been bridged without wheels. It is decided when a sample
/// comes, for itself and for its successor, so that what is interpolated within such a step is no motion either.
class OdometryBuffer {
 public:
  enum class Insertion {
    kInserted,
    kDuplicate,  ///< there is a sample of this stamp already
    kTooOld,     ///< increments up to a later instant have been taken
    kNotFinite,  ///< its pose is no pose, or its stamp no time
    kAhead,      ///< newer than the others by more than the time-out: inserted with the next one if that is as new
  };

  /// timeout: [s] wheels that have told nothing for longer are silent.
  explicit OdometryBuffer(const MotionLimits& limits = {}, double timeout = 1.0) : limits_(limits), timeout_(timeout) {}

  /// For the samples to come.
  void setLimits(const MotionLimits& limits, double timeout);

  /// Samples may come in any order, but not before the instant up to which increments have been taken. guess: what is
  /// assumed if the step to the sample is not known motion.
  Insertion insert(const OdometrySample& sample, const MotionGuess& guess = {});

  /// Covers a stamp newer than all without wheels: the step to it is a guess.
  void bridge(Stamp stamp, const MotionGuess& guess);

  bool empty() const { return samples_.empty(); }
  std::size_t size() const { return samples_.size(); }
  Stamp oldest() const { return samples_.front().stamp; }
  Stamp newest() const { return samples_.back().stamp; }
  bool covers(Stamp stamp) const { return !empty() && oldest() <= stamp && stamp <= newest(); }

  /// Whether the newest instant is one without wheels.
  bool endsBridged() const { return !empty() && samples_.back().bridged; }

  /// Steps to samples that were not known motion, since the beginning.
  std::size_t jumps() const { return jumps_; }

  /// The stamp of the newest sample that is not newer than an instant, which must not be older than the oldest.
  Stamp lastUpTo(Stamp stamp) const;

  struct Step {
    OdometrySample from;
    OdometrySample to;
    std::optional<MotionGuess> guess;  ///< where the samples do not tell the motion
    double interval = 0.0;             ///< [s] between the two samples that it lies between
  };

  /// The motion between two instants that the buffer covers, in steps from sample to sample; the ends interpolated.
  std::vector<Step> steps(Stamp from, Stamp to) const;

  /// Forgets what lies before the sample that brackets the instant.
  void discardBefore(Stamp stamp);

 private:
  struct Entry : OdometrySample {
    std::optional<MotionGuess> guess;  // of the step that ends here, where it is not known motion
    bool bridged = false;              // no sample: an instant without wheels
  };
  using Entries = std::deque<Entry>;

  bool isAhead(const OdometrySample& sample) const;
  Insertion place(const OdometrySample& sample, const MotionGuess& guess);
  void judge(const Entries::iterator& entry, const MotionGuess& guess);
  bool isKnownMotion(const Entry& before, const Entry& after) const;
  Entry at(Stamp stamp) const;

  MotionLimits limits_;
  double timeout_;   // [s]
  Entries samples_;  // sorted by stamp, no two equal
  std::optional<OdometrySample> ahead_;
  std::optional<Stamp> discarded_;
  std::size_t jumps_ = 0;
};

}  // namespace sckf
