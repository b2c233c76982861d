// What replay takes from the command line and from the parameter file that it names.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sckf_odometry/ros/parameters.h"

namespace sckf {

struct ReplayArguments {
  std::string bag;
  std::string trajectory;
  std::string csv;
  std::string params;
  std::string method;
  std::vector<std::string> scan_topics;
  std::string odom_topic = "/odom";
  std::string imu_topic = "/imu";
  std::string pose_update_topic = "/pose_update";
  std::string map_trajectory;
  double start = 0.0;     ///< [s] after the bag's begin
  double duration = 0.0;  ///< [s], 0: to its end
};

/// Nothing if the help was asked for, and shown. Throws boost::program_options::error with option, value and what is
/// expected.
std::optional<ReplayArguments> parseReplayArguments(int argc, char** argv);

/// Throws std::invalid_argument that names the file, the parameter, its value and what is expected, or
/// boost::program_options::error if an option does not go with them.
Options optionsFor(const ReplayArguments& arguments);

}  // namespace sckf
