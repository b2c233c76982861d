#include "sckf_odometry/experiments/cloud_input.h"

#include <cmath>
#include <random>

#include "sckf_odometry/experiments/simulated_world.h"

namespace sckf {

namespace {

Eigen::Isometry3d mountOf(const CloudInputOptions& options) {
  return Eigen::Translation3d(0.2, 0.0, options.sensor_height) *
         Eigen::AngleAxisd(options.pitch, Eigen::Vector3d::UnitY());
}

/// Where a ray from the sensor meets wall or floor, in the sensor's frame; NaN where it passes above the walls.
Eigen::Vector3f hit(const CloudInputOptions& options, const SE2& world_from_base, const Eigen::Vector3d& ray,
                    double noise) {
  const Eigen::Isometry3d mount = mountOf(options);
  const Eigen::Vector3d in_base = mount.linear() * ray;
  const Eigen::Vector2d origin = world_from_base * Eigen::Vector2d(mount.translation().head<2>());
  const Eigen::Vector2d direction = world_from_base.rotation() * in_base.head<2>();
  static const World kRoom = room();
  const double to_wall = castRay(kRoom, origin, direction);
  const double to_floor = in_base.z() < 0.0 ? -options.sensor_height / in_base.z() : INFINITY;
  const double range = std::min(to_wall, to_floor);
  const bool above = options.sensor_height + range * in_base.z() > options.wall_height;
  if (above) return Eigen::Vector3f::Constant(NAN);
  return ((range + noise) * ray).cast<float>();
}

std::vector<Eigen::Vector3f> cloud(const CloudInputOptions& options, const SE2& world_from_base,
                                   std::mt19937_64& random) {
  std::normal_distribution<double> noise(0.0, options.range_std);
  std::vector<Eigen::Vector3f> points;
  for (int ring = 0; ring < options.rings; ++ring) {
    const double share = static_cast<double>(ring) / (options.rings - 1);
    const double elevation = options.lowest + share * (options.highest - options.lowest);
    for (int i = 0; i < options.bearings; ++i) {
      const double bearing = 2.0 * M_PI * i / options.bearings;
      const Eigen::Vector3d ray(std::cos(elevation) * std::cos(bearing), std::cos(elevation) * std::sin(bearing),
                                std::sin(elevation));
      points.push_back(hit(options, world_from_base, ray, noise(random)));
    }
  }
  return points;
}

RunErrors followByClouds(const CloudInputOptions& options, const CloudOptions& clouds, const Path& path) {
  std::mt19937_64 random(options.seed);
  const auto sensor = [&](double t) {
    return projected(cloud(options, path(t), random), Stamp(0), mountOf(options), clouds);
  };
  return follow(path, sensor, PipelineOptions(), options.run);
}

RunErrors followByLaser(const CloudInputOptions& options, const Path& path) {
  std::mt19937_64 random(options.seed);
  SimulatedLaser laser;
  laser.noise = options.range_std;
  laser.base_from_laser.translation().x() = 0.2;
  const auto sensor = [&](double t) {
    return MountedScan{simulateScan(room(), path(t), laser, &random), laser.base_from_laser};
  };
  return follow(path, sensor, PipelineOptions(), options.run);
}

}  // namespace

std::vector<CloudInputRow> simulateCloudInput(const CloudInputOptions& options, const std::vector<int>& beams,
                                              const std::function<void()>& tick) {
  const Path path = swinging(options.yaw_rate);
  std::vector<CloudInputRow> rows{{"laser", SimulatedLaser().beams, followByLaser(options, path)}};
  tick();
  for (const int count : beams) {
    CloudOptions clouds;
    clouds.beams = count;
    rows.push_back({"cloud", count, followByClouds(options, clouds, path)});
    tick();
  }
  CloudOptions everything;
  everything.height_min = -10.0;
  everything.height_max = 10.0;
  rows.push_back({"cloud of every height", everything.beams, followByClouds(options, everything, path)});
  tick();
  return rows;
}

}  // namespace sckf
