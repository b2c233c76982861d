// What can be switched on beside wheels and scans: states that are not cloned, and measurements that are no
// displacements (III-F and V-A of the paper).
#pragma once

#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/pipeline/standstill.h"

namespace sckf {

/// Systematic errors of the wheels and by the floor as states, which scans find where they tell the motion: how large
/// they can be, 0: there is none. See WheelCalibration. Only method sckf_multi has them.
struct CalibrationOptions {
  double distance_std = 0.02;            ///< of the way, as a share of it
  double rotation_std = 0.05;            ///< of a rotation, as a share of it
  double rotation_per_meter_std = 0.05;  ///< [rad/m] the rotation that goes with the way
  double laser_ahead_std = 0.1;          ///< [m] how much farther ahead the laser is of where the wheels turn about
  double floor_std = 0.01;               ///< [m/m] by how much the floor takes the robot along, in x and y of the world
  double way = 1000.0;                   ///< [m] within which they are forgotten
};

/// What an IMU is used for, and how far it is trusted.
struct ImuOptions {
  bool gyro = false;                ///< its yaw rate …
  double gyro_noise = 0.005;        ///< [rad/s/√Hz] with this noise …
  double gyro_bias_std = 0.02;      ///< [rad/s] and a bias that may be as large at the start …
  double gyro_bias_drift = 0.0005;  ///< [rad/s/√s] … and wanders
  bool orientation = false;         ///< its yaw in a world of its own, at the scans …
  double orientation_std = 0.05;    ///< [rad] with this noise …
  double heading_drift = 0.005;     ///< [rad/√s] … while the two worlds come apart
  double timeout = 0.5;             ///< [s] an IMU that tells nothing for longer is silent: nobody waits for it

  bool isUsed() const { return gyro || orientation; }
};

/// The states that the filter has for what is on, if its method has any.
StateOptions statesFor(const CalibrationOptions& calibration, const ImuOptions& imu);

/// The rotation in dt [s] as a gyro tells it, for an increment of which others tell this much.
MotionMeasurement gyroMeasurement(double rotation, double yaw_of_increment, double dt, const ImuOptions& options);

/// A robot that stands, for dt [s].
MotionMeasurement standstillMeasurement(double dt, const StandstillOptions& options);

}  // namespace sckf
