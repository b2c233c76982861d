// Whether the wheels say that the robot stands.
#pragma once

#include "sckf_odometry/core/se2.h"

namespace sckf {

/// A robot whose wheels have told of hardly any motion for some time is taken to stand: encoders jitter, and a gyro at
/// rest tells its bias.
struct StandstillOptions {
  double time = 0.0;       ///< [s] for which that must have been so; 0: never
  double speed = 0.01;     ///< [m/s] that the wheels may tell nevertheless …
  double yaw_rate = 0.01;  ///< [rad/s] … and this
  double std = 0.001;      ///< [m/√s, rad/√s] by how much a robot that stands may move
};

class Standstill {
 public:
  /// Takes a step of the wheels that was made in dt [s], the next in the order of time.
  void add(const SE2& motion, double dt, const StandstillOptions& options);
  /// What the wheels say is not known.
  void interrupt() { stood_ = 0.0; }

  /// In the step added last.
  bool stands(const StandstillOptions& options) const { return options.time > 0.0 && stood_ >= options.time; }

 private:
  double stood_ = 0.0;  // [s]
};

}  // namespace sckf
