// The pose by stereo vision alone, over a straight way (paper VII-C, figure 8).
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "sckf_odometry/experiments/stereo_odometry.h"

namespace sckf {

struct VisualOdometryOptions {
  StereoCamera camera;
  double pixel_std = 0.3;  ///< of a pixel coordinate [pixel]
  double features = 0.4;   ///< per m³ of the space around the way
  double way = 100.0;      ///< [m]
  int runs = 40;           ///< of the Monte Carlo simulation
  std::uint64_t seed = 1;
};

/// Means over the runs at the end of the way: traces of the position's [m²] and the attitude's [rad²] block.
struct VisualOdometryPoint {
  struct Traces {
    double position = 0.0;
    double attitude = 0.0;
  };
  double spacing = 0.0;  ///< [m]
  Traces with_correlations, without;
  Traces scatter;           ///< of the true errors about their mean over the runs
  double mean_error = 0.0;  ///< of the position [m]: triangulation is not quite free of it
  double features = 0.0;    ///< that two successive views share
};

/// Spacings are rounded so that the way is a whole number of them. tick: after each run.
std::vector<VisualOdometryPoint> simulateVisualOdometry(const VisualOdometryOptions& options,
                                                        const std::vector<double>& spacings,
                                                        const std::function<void()>& tick);

}  // namespace sckf
