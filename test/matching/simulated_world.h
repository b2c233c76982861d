// Rooms of straight walls and a laser in them: those of the experiments.
#pragma once

#include <algorithm>
#include <random>
#include <utility>
#include <vector>

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

/// Walls of plaster and shelves: steps of some centimetres every few centimetres.
inline World rough(const World& smooth, double roughness) {
  constexpr double kStep = 0.1;  // [m]
  std::mt19937_64 random(3);
  std::normal_distribution<double> gauss(0.0, roughness);
  World world;
  for (const Wall& wall : smooth) {
    const Eigen::Vector2d way = wall.to - wall.from;
    const Eigen::Vector2d across = quarterTurn(way.normalized());
    const int steps = std::max(1, static_cast<int>(way.norm() / kStep));
    Eigen::Vector2d from = wall.from;
    for (int i = 1; i <= steps; ++i) {
      const Eigen::Vector2d to = wall.from + way * i / steps + gauss(random) * across;
      world.push_back({from, to});
      from = to;
    }
  }
  return world;
}

inline World withPolygon(World world, const std::vector<Eigen::Vector2d>& corners) {
  const World polygon = closedPolygon(corners);
  world.insert(world.end(), polygon.begin(), polygon.end());
  return world;
}

/// A leg or a trunk, nearly round.
inline World withPost(World world, const Eigen::Vector2d& place, double radius) {
  std::vector<Eigen::Vector2d> corners;
  for (int k = 0; k < 8; ++k) {
    const double angle = k * M_PI / 4.0;
    corners.push_back(place + radius * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  }
  return withPolygon(std::move(world), corners);
}

/// Two legs of somebody who stands there.
inline World withSomebodyAt(World world, const Eigen::Vector2d& place) {
  for (const double side : {-0.12, 0.12}) world = withPost(std::move(world), place + Eigen::Vector2d(0.0, side), 0.07);
  return world;
}

}  // namespace sckf::test
