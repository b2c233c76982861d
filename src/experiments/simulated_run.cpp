#include "sckf_odometry/experiments/simulated_run.h"

#include <algorithm>
#include <cmath>

namespace sckf {

namespace {

Stamp stampAt(double t) { return std::chrono::seconds(1000) + toDuration(t); }

/// What the wheels tell of each step: too long a way, and a drift to one side.
SE2 told(const SE2& motion, const RunOptions& options) {
  return {options.wheel_scale * motion.x, options.wheel_scale * motion.y,
          motion.yaw + options.wheel_yaw * motion.translation().norm()};
}

}  // namespace

Path swinging(double yaw_rate) {
  return [yaw_rate](double t) {
    constexpr double kPeriod = 2.0;  // [s] of the head's swing
    const double u = 2.0 * M_PI * t / 15.0;
    const double radius = 1.2 + 0.2 * std::sin(3.0 * u);
    const double swing = yaw_rate * kPeriod / (2.0 * M_PI) * std::sin(2.0 * M_PI * t / kPeriod);
    return SE2(0.4 + radius * std::cos(u), radius * std::sin(u), u + M_PI_2 + swing);
  };
}

RunErrors follow(const Path& world_from_base, const Sensor& sensor, const PipelineOptions& pipeline,
                 const RunOptions& options) {
  return follow(world_from_base, std::vector<RatedSensor>{{sensor, options.scan_rate}}, pipeline, options);
}

RunErrors follow(const Path& world_from_base, const std::vector<RatedSensor>& sensors, const PipelineOptions& pipeline,
                 const RunOptions& options) {
  ScanOdometry odometry(pipeline);
  RunErrors errors;
  const auto account = [&](const ScanReport& report) {
    if (!report.estimate) return;
    const double t = seconds(report.stamp - stampAt(0.0));
    const Eigen::Vector3d e = error(report.estimate->odom_from_base, between(world_from_base(0.0), world_from_base(t)));
    errors.position += e.head<2>().squaredNorm();
    errors.yaw += e.z() * e.z();
    ++errors.scans;
    errors.used += wasUsed(report.outcome) ? 1 : 0;
    options.watch(t, report);
  };
  OdometrySample wheels;
  const double step = 1.0 / options.odometry_rate;
  std::vector<double> next_scan(sensors.size(), 0.37 * step);  // between two samples
  for (int i = 0; i * step <= options.duration; ++i) {
    const double t = i * step;
    wheels.stamp = stampAt(t);
    if (i > 0) {
      const SE2 motion = between(world_from_base(t - step), world_from_base(t));
      wheels.odom_from_base = compose(wheels.odom_from_base, told(motion, options));
    }
    odometry.addOdometry(wheels);
    options.others(t, odometry);
    for (std::size_t laser = 0; laser < sensors.size(); ++laser) {
      for (double& at = next_scan[laser]; at < t; at += 1.0 / sensors[laser].rate) {
        MountedScan mounted = sensors[laser].sensor(at);
        mounted.scan.stamp = stampAt(at);
        odometry.addScan(mounted.scan, mounted.base_from_laser, laser);
      }
    }
    for (const ScanReport& report : odometry.process()) account(report);
  }
  const double n = std::max(1, errors.scans);
  errors.position = std::sqrt(errors.position / n);
  errors.yaw = std::sqrt(errors.yaw / n);
  return errors;
}

}  // namespace sckf
