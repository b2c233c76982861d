// Rooms of straight walls and a laser in them: those of the experiments.
#pragma once

#include "sckf_odometry/experiments/simulated_world.h"

namespace sckf::test {

using sckf::castRay;
using sckf::closedPolygon;
using sckf::corridor;
using sckf::frontLaser;
using sckf::rearLaser;
using sckf::room;
using sckf::SimulatedLaser;
using sckf::simulateScan;
using sckf::simulateSweep;
using sckf::Wall;
using sckf::World;

}  // namespace sckf::test
