// Robots between straight walls whose filter takes more than wheels and scans: a gyro, a compass, absolute poses, that
// it stands, and the systematic errors of its wheels (III-F and V-A of the paper).
#pragma once

#include <cstdint>
#include <vector>

#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/core/odometry_model.h"
#include "sckf_odometry/experiments/room_simulation.h"

namespace sckf {

/// What the robots have. Every error is drawn from the noise that the filter is told.
struct SimulatedSensors {
  std::vector<StraightWall> walls = simulatedHall();
  int scans_until = 1000;    ///< after so many scans the laser is blind
  StateOptions states;       ///< by how much wheels and sensors err; the filter estimates it …
  bool calibrated = true;    ///< … but for the wheels', if false: it takes them for right
  double gyro_std = 0.0;     ///< [rad/√s] noise of a gyro; 0: there is none
  double compass_std = 0.0;  ///< [rad] of a compass, whose zero is not known; 0: there is none
  double pose_std = 0.0;     ///< [m, rad] of absolute poses in another world; 0: there are none
  bool stands = false;       ///< it stands now and then, while its encoders jitter …
  bool knows_that_it_stands = true;
};

OdometryNoise simulatedWheelNoise();

/// One of each kind, and all of them.
SimulatedSensors wheelsThatErr();
SimulatedSensors gyro();
SimulatedSensors compass();
SimulatedSensors absolutePoses();
SimulatedSensors standingNowAndThen();
SimulatedSensors everySensor();

struct OtherMeasurementsOptions {
  int runs = 200;
  int scans = 40;  ///< one each 0.2 s
  std::uint64_t seed = 2000;
};

/// One state of the first robot, scan by scan.
struct TracedState {
  std::vector<double> truth;
  std::vector<double> estimate;
  std::vector<double> std;
};

/// Means over the robots, one entry per scan; number 0 is the start, and zero.
struct SensorStatistics {
  explicit SensorStatistics(int scans);

  std::vector<double> pose;                 ///< squared normalised errors: 3 is right …
  std::vector<double> calibration;          ///< … 6 …
  std::vector<double> bias;                 ///< … and 1, of the gyro
  std::vector<double> squared_error;        ///< of the position [m²]
  std::vector<double> squared_yaw;          ///< [rad²]
  std::vector<double> squared_calibration;  ///< of the scale of distance
  std::vector<double> squared_bias;         ///< [rad²/s²]
  std::vector<double> variance;             ///< of the position, that the filter tells [m²]
  TracedState traced_bias;                  ///< [rad/s]
  TracedState traced_scale;                 ///< of distance
};

SensorStatistics simulateOtherMeasurements(const SimulatedSensors& sensors, const OtherMeasurementsOptions& options);

}  // namespace sckf
