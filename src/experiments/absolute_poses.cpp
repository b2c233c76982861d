#include "sckf_odometry/experiments/absolute_poses.h"

#include <cmath>
#include <limits>
#include <optional>

#include "sckf_odometry/experiments/random_draws.h"
#include "sckf_odometry/experiments/simulated_world.h"

namespace sckf {

namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/// What the scans report of one drive.
struct Drive {
  std::vector<double> times;
  std::vector<SE2> in_odom;
  std::vector<std::optional<SE2>> in_map;
};

/// Of the whole pipeline; absolute poses have noise, the same every time.
Drive drive(const AbsolutePosesOptions& options, const Path& path, bool told) {
  PipelineOptions pipeline;
  pipeline.pose_updates.on = told;
  pipeline.scan.min_points = 1000000;  // no scan has so many
  RunOptions run = options.run;
  RandomDraws random(options.seed);
  const Eigen::Matrix3d R = options.pose_std * options.pose_std * Eigen::Matrix3d::Identity();
  double next_pose = options.period;
  run.others = [&](double t, ScanOdometry& odometry) {
    if (!told || t < next_pose) return;
    next_pose += options.period;
    const SE2 truth = compose(options.map_from_odom, between(path(0.0), path(t)));
    odometry.addPose({std::chrono::seconds(1000) + toDuration(t), {corrected(truth, random.drawnFrom(R)), R}});
  };
  Drive seen;
  run.watch = [&seen](double t, const ScanReport& report) {
    seen.times.push_back(t);
    seen.in_odom.push_back(report.estimate->odom_from_base);
    seen.in_map.push_back(report.in_map ? std::optional(report.in_map->map_from_base) : std::nullopt);
  };
  const Sensor laser = [&path](double t) {
    return MountedScan{simulateScan(room(), path(t), SimulatedLaser()), Eigen::Isometry3d::Identity()};
  };
  follow(path, laser, pipeline, run);
  return seen;
}

double distance(const SE2& a, const SE2& b) { return (a.translation() - b.translation()).norm(); }

/// What was estimated of a motion against what was made, in base_link before it.
double step(const SE2& before, const SE2& after, const SE2& truth_before, const SE2& truth_after) {
  return distance(between(before, after), between(truth_before, truth_after));
}

}  // namespace

std::vector<AbsolutePosesPoint> simulateAbsolutePoses(const AbsolutePosesOptions& options) {
  const Path path = swinging(0.5);
  const Drive with = drive(options, path, true);
  const Drive without = drive(options, path, false);
  const auto truth = [&](std::size_t i) { return between(path(0.0), path(with.times[i])); };
  std::vector<AbsolutePosesPoint> points;
  for (std::size_t i = 1; i < with.times.size(); ++i) {
    AbsolutePosesPoint p;
    p.time = with.times[i];
    p.odom_error = distance(with.in_odom[i], truth(i));
    p.odom_step = step(with.in_odom[i - 1], with.in_odom[i], truth(i - 1), truth(i));
    p.moved = distance(with.in_odom[i], without.in_odom[i]);
    p.map_error = p.map_step = kUnknown;
    if (with.in_map[i]) p.map_error = distance(*with.in_map[i], compose(options.map_from_odom, truth(i)));
    if (with.in_map[i] && with.in_map[i - 1]) {
      p.map_step = step(*with.in_map[i - 1], *with.in_map[i], truth(i - 1), truth(i));
    }
    points.push_back(p);
  }
  return points;
}

}  // namespace sckf
