// Reads what an MRPT rawlog of actions and sensory frames holds of one laser and the wheels.
#pragma once

#include <mrpt/obs/CObservation2DRangeScan.h>
#include <ros/time.h>

#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "sckf_odometry/core/se2.h"

namespace sckf {

/// One scan of the log, and where the wheels say the robot was.
struct RawlogRecord {
  mrpt::obs::CObservation2DRangeScan::Ptr scan;
  SE2 odom_from_base;
  std::optional<ros::Time> log_stamp;  ///< what the log says, if anything
  ros::Time stamp;                     ///< the one to use: the log's own, or made up
};

struct Rawlog {
  std::vector<RawlogRecord> records;
  size_t movements = 0;     ///< odometry increments seen
  size_t other_scans = 0;   ///< scans of other lasers, left out
  bool own_stamps = false;  ///< whether the stamps are the log's own
};

/// What is wrong with an input; meant to be shown to a person.
struct RawlogError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Every scan of one laser: the one with the label, or without a label the first that the log has. Wheel odometry is
/// put end to end from the identity at the first scan. Stamps are the log's own if every scan has one and they
/// increase; otherwise all of them are made up, `period` [s] apart from the first valid one (or from 1 s). Throws
/// RawlogError.
Rawlog readRawlog(const std::string& path, const std::string& sensor_label, double period);

}  // namespace sckf
