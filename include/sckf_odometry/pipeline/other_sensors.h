// What can be switched on beside wheels and scans: states that are not cloned, and measurements that are no
// displacements (III-F and V-A of the paper).
#pragma once

#include "sckf_odometry/core/fusion_method.h"

namespace sckf {

/// Systematic errors of the wheels as states, which scans find where they tell the motion. See WheelCalibration.
struct CalibrationOptions {
  bool on = false;
  double distance_std = 0.05;            ///< how large the error of the way can be, as a share of it …
  double rotation_std = 0.05;            ///< … that of a rotation …
  double rotation_per_meter_std = 0.05;  ///< [rad/m] … and the rotation that goes with the way
  double way = 100.0;                    ///< [m] within which they are forgotten
};

/// The states that the filter has for what is on.
StateOptions statesFor(const CalibrationOptions& calibration);

}  // namespace sckf
