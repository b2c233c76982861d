// What experiment_data takes from the command line, and the tables that it writes of the extensions.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "sckf_odometry/experiments/absolute_poses.h"
#include "sckf_odometry/experiments/cloud_input.h"
#include "sckf_odometry/experiments/deskewing.h"
#include "sckf_odometry/experiments/line_matching.h"
#include "sckf_odometry/experiments/mounted_lasers.h"
#include "sckf_odometry/experiments/odometry_models.h"
#include "sckf_odometry/experiments/one_dimension.h"
#include "sckf_odometry/experiments/other_measurements.h"
#include "sckf_odometry/experiments/several_lasers.h"
#include "sckf_odometry/experiments/visual_odometry.h"

namespace sckf {

/// Every experiment has its options; of the command line it takes those that are its own.
struct Arguments {
  std::string name;
  std::string output = ".";
  int runs = 0;  // 0: as the experiment has it
  std::uint64_t seed = 1;
  OneDimensionOptions one_dimension;
  LineMatchingOptions line_matching;
  VisualOdometryOptions visual_odometry;
  DeskewingOptions deskewing;
  CloudInputOptions cloud_input;
  OdometryModelsOptions odometry_models;
  SeveralLasersOptions several_lasers;
  MountedLasersOptions mounted_lasers;
  OtherMeasurementsOptions other_measurements;
  AbsolutePosesOptions absolute_poses;

  std::string file(const std::string& table) const { return output + "/" + table + ".csv"; }
};

/// By the name of the experiment, which writes its tables.
using Experiments = std::map<std::string, std::function<void(const Arguments&)>>;
const Experiments& extensions();

}  // namespace sckf
