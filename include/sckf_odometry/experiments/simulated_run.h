// A robot in the simulated room, followed by the whole pipeline: how far off the estimate is.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "sckf_odometry/matching/point_cloud.h"
#include "sckf_odometry/pipeline/scan_odometry.h"

namespace sckf {

/// Where base_link is in the room after t [s].
using Path = std::function<SE2(double t)>;

/// What a sensor says whose message has the stamp t [s]; the scan's stamp is set by who asks.
using Sensor = std::function<MountedScan(double t)>;

/// A sensor of a robot that has several.
struct RatedSensor {
  Sensor sensor;
  double rate;  ///< [1/s]
};

struct RunOptions {
  double duration = 10.0;       ///< [s]
  double odometry_rate = 50.0;  ///< [1/s]
  double scan_rate = 10.0;      ///< [1/s]
  double wheel_scale = 1.03;    ///< way that the wheels tell over that made …
  double wheel_yaw = 0.03;      ///< [rad/m] … and rotation that they add to it

  /// Asked at each sample of odometry: what else is told.
  std::function<void(double t, ScanOdometry& odometry)> others = [](double, ScanOdometry&) {};
  /// Told of each scan that has an estimate.
  std::function<void(double t, const ScanReport& report)> watch = [](double, const ScanReport&) {};
};

struct RunErrors {
  double position = 0.0;  ///< rms over the scans [m] …
  double yaw = 0.0;       ///< … and [rad]
  int scans = 0;
  int used = 0;  ///< of them, that corrected the estimate
};

/// Once round the middle of the room in 15 s, weaving, the head turned to and fro at up to a yaw rate [rad/s].
Path swinging(double yaw_rate);

/// The pipeline along the path, fed with the wheels and with what the sensor says.
RunErrors follow(const Path& world_from_base, const Sensor& sensor, const PipelineOptions& pipeline,
                 const RunOptions& options);

/// … and with what several sensors say, each at its rate; of the options' scan_rate nothing is used.
RunErrors follow(const Path& world_from_base, const std::vector<RatedSensor>& sensors, const PipelineOptions& pipeline,
                 const RunOptions& options);

}  // namespace sckf
