#include "sckf_odometry/pipeline/other_sensors.h"

namespace sckf {

StateOptions statesFor(const CalibrationOptions& calibration) {
  StateOptions states;
  if (calibration.on) {
    states.calibration_std << calibration.distance_std, calibration.rotation_std, calibration.rotation_per_meter_std;
    states.calibration_way = calibration.way;
  }
  return states;
}

}  // namespace sckf
