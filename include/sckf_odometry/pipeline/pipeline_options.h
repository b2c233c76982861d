// All that can be chosen about the way of a scan.
#pragma once

#include <cstddef>
#include <string>

#include "sckf_odometry/core/odometry_model.h"
#include "sckf_odometry/pipeline/displacement_updates.h"
#include "sckf_odometry/pipeline/landmarks.h"
#include "sckf_odometry/pipeline/other_sensors.h"
#include "sckf_odometry/pipeline/unknown_motion.h"

namespace sckf {

struct PipelineOptions : DisplacementOptions {
  std::string method = "sckf_multi";  ///< one of fusionMethodNames()
  OdometryNoise odometry_noise;
  CalibrationOptions calibration;
  ImuOptions imu;
  StandstillOptions standstill;
  PoseUpdateOptions pose_updates;
  bool prefer_twist_covariance = false;  ///< use the twist covariance of the odometry message where it is sensible
  ScanOptions scan;
  double range_offset_std = 0.015;   ///< [m] how wrong all ranges of a laser may be together: estimated; 0: not at all
  double sweep_duration_std = 0.01;  ///< [s] how long a laser may take for a scan: estimated; 0: motion meanwhile stays
  bool deskew = false;  ///< undo the motion while a scan is taken; it waits for odometry at its last beam then
  LandmarkOptions landmarks;
  MotionLimits motion;
  double twist_window = 0.2;      ///< [s] the twist is the mean over this time: stamps of odometry come in bursts
  double max_scan_delay = 5.0;    ///< [s] a scan that is older than the newest odometry by more is not used
  int max_waiting_scans = 50;     ///< scans that wait for odometry; beyond, the one that has waited longest is given up
  double odometry_timeout = 1.0;  ///< [s] wheels whose newest odometry is older than scans by more are silent
  bool scans_alone = false;       ///< silent wheels: the scans carry on alone; false: the estimate waits
  std::size_t lasers = 1;         ///< how many there are; more than one by sckf_multi only
  double scan_patience = 0.25;    ///< [s] of several lasers: a scan waits so long for older ones of the others
};

/// Throws std::invalid_argument with name, value and what is expected if there is no method, or no odometry model, of
/// that name, or if the method lacks what the options ask for.
void check(const PipelineOptions& options);

/// The same of options that an estimate shall go on with; and throws if they change what only a new one can.
void checkChange(const PipelineOptions& from, const PipelineOptions& to);

}  // namespace sckf
