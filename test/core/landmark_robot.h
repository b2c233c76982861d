// A simulated robot that meets landmarks, for the tests of their states: whether their covariance can be believed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/random_inputs.h"
#include "sckf_odometry/core/landmark_states.h"

namespace sckf {

/// Landmarks of one kind.
struct LandmarkWorld {
  std::vector<SE2> (*places)(RandomInputs& random);
  Sighting (*exact)(const SE2& base_from_landmark);                               ///< without an error
  Sighting (*seen)(const SE2& robot, const SE2& landmark, RandomInputs& random);  ///< with one
  int degrees_of_freedom;
  std::size_t most;  ///< in the state; beyond, the oldest is given up
  std::uint64_t seed;
};

/// Landmarks alone and beside displacements, which together are the best.
void expectConsistentAndBestTogether(const LandmarkWorld& world);

}  // namespace sckf
