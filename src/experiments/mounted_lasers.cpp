#include "sckf_odometry/experiments/mounted_lasers.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>

#include "sckf_odometry/experiments/simulated_world.h"

namespace sckf {

namespace {

RatedSensor rated(SimulatedLaser laser, double rate, double noise, const Path& path, std::uint64_t seed) {
  laser.noise = noise;
  const auto random = std::make_shared<std::mt19937_64>(seed);
  const Sensor sensor = [laser, path, random](double t) {
    return MountedScan{simulateScan(room(), path(t), laser, random.get()), laser.base_from_laser};
  };
  return {sensor, rate};
}

/// Errors of two sets of scans together.
RunErrors together(const RunErrors& a, const RunErrors& b) {
  const double n = std::max(1, a.scans + b.scans);
  const auto rms = [&](double x, double y) { return std::sqrt((a.scans * x * x + b.scans * y * y) / n); };
  return {rms(a.position, b.position), rms(a.yaw, b.yaw), a.scans + b.scans, a.used + b.used};
}

}  // namespace

std::vector<MountedLasersRow> simulateMountedLasers(const MountedLasersOptions& options,
                                                    const std::function<void()>& tick) {
  const Path path = swinging(options.yaw_rate);
  std::vector<MountedLasersRow> rows;
  for (const std::string lasers : {"front", "rear", "both"}) {
    RunErrors errors;
    for (int drive = 0; drive < options.drives; ++drive) {
      const std::uint64_t seed = options.seed + 2 * static_cast<std::uint64_t>(drive);
      std::vector<RatedSensor> sensors;
      const auto mount = [&](const SimulatedLaser& laser, double rate, std::uint64_t noise) {
        sensors.push_back(rated(laser, rate, options.range_std, path, noise));
      };
      if (lasers != "rear") mount(frontLaser(), options.front_rate, seed);
      if (lasers != "front") mount(rearLaser(), options.rear_rate, seed + 1);
      PipelineOptions pipeline;
      pipeline.lasers = sensors.size();
      errors = together(errors, follow(path, sensors, pipeline, options.run));
    }
    rows.push_back({lasers, errors});
    tick();
  }
  return rows;
}

}  // namespace sckf
