// Two lasers on one robot, each with clones and range noise of its own, at rates of their own (V-A of the paper).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "sckf_odometry/experiments/room_simulation.h"

namespace sckf {

struct SimulatedLaserRate {
  RoomSimulation room;
  int every;            ///< so many ticks there is a scan …
  int reference;        ///< … of which every so many become a reference …
  std::size_t kept;     ///< … and so many are kept
  int until = 1 << 20;  ///< before this tick: then it fails
};

/// 40 Hz and 30 mm of noise; 5 Hz and 10 mm.
SimulatedLaserRate fastLaser();
SimulatedLaserRate slowLaser();

struct SeveralLasersOptions {
  int runs = 200;
  int ticks = 80;  ///< of 25 ms
  std::uint64_t seed = 3000;
};

/// Means over the robots, one entry per tick, the start included.
struct SeveralLasersStatistics {
  std::vector<double> nees;           ///< of the pose: 3 is right
  std::vector<double> squared_error;  ///< of the position [m²]
};

/// A robot in a hall, for each run.
SeveralLasersStatistics simulateSeveralLasers(const std::vector<SimulatedLaserRate>& lasers,
                                              const SeveralLasersOptions& options);

}  // namespace sckf
