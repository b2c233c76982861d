// Robots whose wheels err as those of three kinds do, and what the models of odometry say of it.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "sckf_odometry/core/odometry_model.h"

namespace sckf {

struct OdometryModelsOptions {
  double step = 0.02;  ///< [m] or [rad] in which the wheels err
  int steps_told = 5;  ///< so many of them are one increment of odometry
  int runs = 400;
  std::uint64_t seed = 1;
};

struct OdometryModelsRow {
  std::string robot;          ///< the kind of its wheels, named as the models are
  std::string model;          ///< one of odometryModelNames()
  double nees = 0.0;          ///< at the end of the way, mean over the runs: 3 is right
  double largest_std = 0.0;   ///< [m] of the position at the end, by the model …
  double smallest_std = 0.0;  ///< [m] … and across
};

/// Each robot drives straight on and through bends to either side (and, if it can, turns on the spot), by wheels alone;
/// each model is told the numbers that are true for the robot.
std::vector<OdometryModelsRow> simulateOdometryModels(const OdometryModelsOptions& options,
                                                      const std::function<void()>& tick);

}  // namespace sckf
