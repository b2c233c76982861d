// Rooms of straight walls and a laser in them.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <vector>

#include "sckf_odometry/core/se2.h"
#include "sckf_odometry/matching/laser_scan.h"

namespace sckf {

struct Wall {
  Eigen::Vector2d from;
  Eigen::Vector2d to;
};
using World = std::vector<Wall>;

inline World closedPolygon(const std::vector<Eigen::Vector2d>& corners) {
  World world;
  for (std::size_t i = 0; i < corners.size(); ++i) world.push_back({corners[i], corners[(i + 1) % corners.size()]});
  return world;
}

/// A room of 8 m × 6 m with a bay and a pillar, its origin inside.
///
///        +--------------+
///        |    []        +---+
///        |   o              |
///        |              +---+
///        +--------------+
inline World room() {
  World world = closedPolygon(
      {{-3.0, -2.5}, {5.0, -2.5}, {5.0, -0.5}, {6.5, -0.5}, {6.5, 1.5}, {5.0, 1.5}, {5.0, 3.5}, {-3.0, 3.5}});
  const World pillar = closedPolygon({{1.5, 1.8}, {2.3, 1.8}, {2.3, 2.6}, {1.5, 2.6}});
  world.insert(world.end(), pillar.begin(), pillar.end());
  return world;
}

/// Two walls 3 m apart along x, whose ends no laser of 30 m range sees.
inline World corridor() { return {{{-100.0, -1.5}, {100.0, -1.5}}, {{-100.0, 1.5}, {100.0, 1.5}}}; }

/// Distance along a ray to the nearest wall, infinite if there is none.
inline double castRay(const World& world, const Eigen::Vector2d& origin, const Eigen::Vector2d& direction) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Wall& wall : world) {
    Eigen::Matrix2d A;
    A << direction, wall.from - wall.to;
    if (std::abs(A.determinant()) < 1e-12) continue;
    const Eigen::Vector2d solution = A.inverse() * (wall.from - origin);
    const bool hit = solution.x() > 0.0 && solution.y() >= 0.0 && solution.y() <= 1.0;
    if (hit) nearest = std::min(nearest, solution.x());
  }
  return nearest;
}

struct SimulatedLaser {
  int beams = 361;
  double angle_min = -M_PI;
  double angle_increment = 2.0 * M_PI / 361.0;
  double time_increment = 0.0;  ///< [s] from one beam to the next
  double range_max = 30.0;
  double noise = 0.0;   ///< std of a range [m]
  double offset = 0.0;  ///< all ranges are too long by [m]
  Eigen::Isometry3d base_from_laser = Eigen::Isometry3d::Identity();
};

/// Sees half a round ahead of the robot.
inline SimulatedLaser frontLaser() {
  SimulatedLaser laser;
  laser.beams = 181;
  laser.angle_min = -M_PI / 2;
  laser.angle_increment = M_PI / 180.0;
  laser.noise = 0.01;
  laser.base_from_laser = Eigen::Translation3d(0.3, 0.0, 0.2);
  return laser;
}

/// Sees half a round behind it, turned and upside down as such things are mounted.
inline SimulatedLaser rearLaser() {
  SimulatedLaser laser = frontLaser();
  laser.base_from_laser = Eigen::Translation3d(-0.3, 0.1, 0.4) *
                          Eigen::AngleAxisd(M_PI - 0.2, Eigen::Vector3d::UnitZ()) *
                          Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX());
  return laser;
}

/// A scan that base_link moves during: world_from_base so many seconds after the stamp. random may be null if the laser
/// has no noise.
inline LaserScan simulateSweep(const World& world, const std::function<SE2(double)>& world_from_base_at,
                               const SimulatedLaser& laser, std::mt19937_64* random = nullptr) {
  std::normal_distribution<double> normal(0.0, 1.0);
  LaserScan scan;
  scan.angle_min = laser.angle_min;
  scan.angle_increment = laser.angle_increment;
  scan.time_increment = laser.time_increment;
  scan.range_min = 0.05;
  scan.range_max = laser.range_max;
  for (int i = 0; i < laser.beams; ++i) {
    const double bearing = laser.angle_min + i * laser.angle_increment;
    const SE2 world_from_base = world_from_base_at(i * laser.time_increment);
    const Eigen::Vector3d ray =
        laser.base_from_laser.linear() * Eigen::Vector3d(std::cos(bearing), std::sin(bearing), 0);
    const Eigen::Vector2d origin = world_from_base * Eigen::Vector2d(laser.base_from_laser.translation().head<2>());
    const double range = castRay(world, origin, world_from_base.rotation() * ray.head<2>());
    const double noise = random != nullptr ? laser.noise * normal(*random) : 0.0;
    scan.ranges.push_back(static_cast<float>(range + laser.offset + noise));
  }
  return scan;
}

/// A scan taken at once, with base_link at a pose of the world.
inline LaserScan simulateScan(const World& world, const SE2& world_from_base, const SimulatedLaser& laser,
                              std::mt19937_64* random = nullptr) {
  return simulateSweep(
      world, [&world_from_base](double) { return world_from_base; }, laser, random);
}

}  // namespace sckf
