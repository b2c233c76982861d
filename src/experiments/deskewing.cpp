#include "sckf_odometry/experiments/deskewing.h"

#include <random>

#include "sckf_odometry/experiments/simulated_world.h"

namespace sckf {

namespace {

/// The laser that the options describe, on a robot on its path. The same scans every time.
Sensor sweepingLaser(const DeskewingOptions& options, const Path& path) {
  SimulatedLaser laser;
  laser.beams = options.beams;
  laser.angle_increment = 2.0 * M_PI / options.beams;
  laser.time_increment = options.sweep / (options.beams - 1);
  laser.noise = options.range_std;
  const auto random = std::make_shared<std::mt19937_64>(options.seed);
  return [laser, path, random](double t) {
    const auto later = [&path, t](double by) { return path(t + by); };
    return MountedScan{simulateSweep(room(), later, laser, random.get()), laser.base_from_laser};
  };
}

}  // namespace

std::vector<DeskewingPoint> simulateDeskewing(const DeskewingOptions& options, const std::vector<double>& yaw_rates,
                                              const std::function<void()>& tick) {
  std::vector<DeskewingPoint> points;
  for (const double yaw_rate : yaw_rates) {
    const Path path = swinging(yaw_rate);
    PipelineOptions pipeline;
    DeskewingPoint point;
    point.yaw_rate = yaw_rate;
    point.estimated = follow(path, sweepingLaser(options, path), pipeline, options.run);
    pipeline.sweep_duration_std = 0.0;
    point.without = follow(path, sweepingLaser(options, path), pipeline, options.run);
    pipeline.deskew = true;
    point.with = follow(path, sweepingLaser(options, path), pipeline, options.run);
    points.push_back(point);
    tick();
  }
  return points;
}

}  // namespace sckf
