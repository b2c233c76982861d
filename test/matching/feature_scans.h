// What the tests of corners and lines see: a fine laser all round, its scans, and a wall that has neither.
#pragma once

#include <cmath>
#include <stdexcept>
#include <vector>

#include "matching/simulated_world.h"
#include "sckf_odometry/matching/prepared_scan.h"

namespace sckf::test {

/// noise: standard deviation of a range [m].
inline SimulatedLaser fineLaser(double noise = 0.0) {
  SimulatedLaser laser;
  laser.beams = 721;
  laser.angle_increment = 2.0 * M_PI / 721.0;
  laser.noise = noise;
  return laser;
}

/// However few its points are; throws if it has none.
inline PreparedScan prepare(const LaserScan& scan) {
  ScanOptions options;
  options.min_points = 3;
  const auto prepared = prepareScan(scan, Eigen::Isometry3d::Identity(), options);
  if (prepared == nullptr) throw std::logic_error("A simulated scan has fewer than 3 points.");
  return *prepared;
}

/// Without noise, from the origin.
inline PreparedScan scanOf(const World& world) { return prepare(simulateScan(world, SE2(), fineLaser())); }

/// About the origin.
inline World roundWall(double radius) {
  std::vector<Eigen::Vector2d> posts;
  for (int i = 0; i < 90; ++i) {
    const double a = 2.0 * M_PI * i / 90.0;
    posts.emplace_back(radius * std::cos(a), radius * std::sin(a));
  }
  return closedPolygon(posts);
}

}  // namespace sckf::test
