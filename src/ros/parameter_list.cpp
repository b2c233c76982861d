// The one list of all parameters. A new option needs a line here and its entry in config/sckf_odometry.yaml.
#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/ros/parameters.h"

namespace sckf {

namespace {

Range atLeast(double min) { return {min, Range().max, false, false}; }
Range above(double min) { return {min, Range().max, true, false}; }
Range within(double min, double max) { return {min, max, false, false}; }
Range strictlyWithin(double min, double max) { return {min, max, true, true}; }

Parameter flag(const std::string& name, bool& field) { return {name, &field, {}, "", {}}; }

Parameter text(const std::string& name, std::string& field, const std::vector<std::string>& choices = {}) {
  return {name, &field, {}, "", choices};
}

template <typename Number>
Parameter number(const std::string& name, Number& field, const Range& range, const std::string& unit = "") {
  return {name, &field, range, unit, {}};
}

using List = std::vector<Parameter>;

List nodeParameters(NodeOptions& node) {
  return {
      text("odom_frame", node.odom_frame),
      text("base_frame", node.base_frame),
      flag("publish_tf", node.publish_tf),
      flag("invert_odom_tf", node.invert_odom_tf),
      flag("use_tf_odometry", node.use_tf_odometry),
      text("tf_odometry_frame", node.tf_odometry_frame),
      number("queue_size", node.queue_size, within(1, 1e6), "messages"),
      number("time_jump", node.time_jump, above(0.0), "s"),
      number("visualization_rate", node.visualization_rate, within(0.0, 100.0), "1/s"),
      number("path_distance", node.path_distance, atLeast(0.0), "m"),
      number("path_max_poses", node.path_max_poses, within(2, 1e6), "poses"),
      number("cloud_resolution", node.cloud_resolution, within(0.001, 10.0), "m"),
      number("cloud_max_points", node.cloud_max_points, within(1, 1e7), "points"),
  };
}

List pipelineParameters(PipelineOptions& pipeline) {
  OdometryNoise& noise = pipeline.odometry_noise;
  return {
      text("method", pipeline.method, fusionMethodNames()),
      number("odometry_translation_per_meter", noise.translation_per_meter, within(0.0, 10.0), "m/sqrt(m)"),
      number("odometry_translation_per_radian", noise.translation_per_radian, within(0.0, 10.0), "m/sqrt(rad)"),
      number("odometry_yaw_per_meter", noise.yaw_per_meter, within(0.0, 10.0), "rad/sqrt(m)"),
      number("odometry_yaw_per_radian", noise.yaw_per_radian, within(0.0, 10.0), "rad/sqrt(rad)"),
      flag("prefer_twist_covariance", pipeline.prefer_twist_covariance),
      number("kf_dist_linear", pipeline.kf_dist_linear, atLeast(0.0), "m"),
      number("kf_dist_angular", pipeline.kf_dist_angular, atLeast(0.0), "rad"),
      number("kf_min_overlap", pipeline.kf_min_overlap, within(0.0, 1.0)),
      number("gate_probability", pipeline.gate_probability, strictlyWithin(0.0, 1.0)),
      number("max_waiting_scans", pipeline.max_waiting_scans, within(1, 1e5), "scans"),
  };
}

List scanParameters(ScanOptions& scan) {
  return {
      number("range_min", scan.range_min, atLeast(0.0), "m"),
      number("range_max", scan.range_max, above(0.0), "m"),
      number("range_noise_min", scan.range_noise_min, above(0.0), "m"),
      number("range_noise_max", scan.range_noise_max, above(0.0), "m"),
      number("min_points", scan.min_points, within(3, 1e6), "points"),
  };
}

List matcherParameters(MatcherOptions& matcher) {
  return {
      number("max_iterations", matcher.max_iterations, within(1, 1000)),
  };
}

}  // namespace

std::vector<Parameter> parameterList(Options& options) {
  List all = nodeParameters(options.node);
  for (const List& list : {pipelineParameters(options.pipeline), scanParameters(options.pipeline.scan),
                           matcherParameters(options.pipeline.matcher)}) {
    all.insert(all.end(), list.begin(), list.end());
  }
  return all;
}

}  // namespace sckf
