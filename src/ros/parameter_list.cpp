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

List odometryParameters(PipelineOptions& pipeline) {
  OdometryNoise& noise = pipeline.odometry_noise;
  return {
      number("odometry_translation_per_meter", noise.translation_per_meter, within(0.0, 10.0), "m/sqrt(m)"),
      number("odometry_translation_per_radian", noise.translation_per_radian, within(0.0, 10.0), "m/sqrt(rad)"),
      number("odometry_yaw_per_meter", noise.yaw_per_meter, within(0.0, 10.0), "rad/sqrt(m)"),
      number("odometry_yaw_per_radian", noise.yaw_per_radian, within(0.0, 10.0), "rad/sqrt(rad)"),
      flag("prefer_twist_covariance", pipeline.prefer_twist_covariance),
      number("twist_window", pipeline.twist_window, above(0.0), "s"),
  };
}

List estimationParameters(PipelineOptions& pipeline) {
  ReferenceOptions& reference = pipeline.reference;
  GateOptions& gate = pipeline.gate;
  return {
      text("method", pipeline.method, fusionMethodNames()),
      number("kf_dist_linear", reference.kf_dist_linear, atLeast(0.0), "m"),
      number("kf_dist_angular", reference.kf_dist_angular, atLeast(0.0), "rad"),
      number("kf_min_overlap", reference.kf_min_overlap, within(0.0, 1.0)),
      number("kf_max_failures", reference.kf_max_failures, within(1, 1000), "scans"),
      number("gate_probability", gate.probability, strictlyWithin(0.0, 1.0)),
      flag("trust_scans_on_slip", gate.trust_scans_on_slip),
      number("slip_std_translation", gate.slip_std_translation, atLeast(0.0), "m"),
      number("slip_std_yaw", gate.slip_std_yaw, atLeast(0.0), "rad"),
      number("slip_min_overlap", gate.slip_min_overlap, within(0.0, 1.0)),
      number("slip_max_residual", gate.slip_max_residual, above(0.0)),
      number("max_scan_delay", pipeline.max_scan_delay, above(0.0), "s"),
      number("max_waiting_scans", pipeline.max_waiting_scans, within(1, 100000), "scans"),
  };
}

List scanParameters(ScanOptions& scan) {
  return {
      number("range_min", scan.range_min, atLeast(0.0), "m"),
      number("range_max", scan.range_max, above(0.0), "m"),
      number("range_noise_min", scan.range_noise_min, above(0.0), "m"),
      number("range_noise_max", scan.range_noise_max, above(0.0), "m"),
      number("min_points", scan.min_points, within(3, 1000000), "points"),
      number("max_beams", scan.max_beams, within(20, 1000000), "beams"),
      number("surface_straightness", scan.surface.straightness, above(0.0)),
      number("surface_length", scan.surface.length, above(0.0), "m"),
      number("surface_max_normal_std", scan.surface.max_normal_std, above(0.0), "rad"),
  };
}

List matcherParameters(MatcherOptions& matcher) {
  PairOptions& pairs = matcher.pairs;
  EstimationOptions& estimation = matcher.estimation;
  return {
      number("icp_pair_distance", matcher.icp_pair_distance, above(0.0), "m"),
      number("max_iterations", matcher.max_iterations, within(1, 1000)),
      number("prior_std_translation", matcher.prior_std_translation, above(0.0), "m"),
      number("prior_std_yaw", matcher.prior_std_yaw, above(0.0), "rad"),
      number("search_below_overlap", matcher.search_below_overlap, within(0.0, 1.0)),
      number("search_yaw_step", matcher.search_yaw_step, above(0.0), "rad"),
      number("search_yaw_steps", matcher.search_yaw_steps, within(0, 1000)),
      number("min_pairs", matcher.min_pairs, within(3, 1000000), "points"),
      number("min_overlap", matcher.min_overlap, within(0.0, 1.0)),
      number("max_refinement", matcher.max_refinement, above(0.0), "m, rad"),
      number("max_correspondence_dist", pairs.max_distance, above(0.0), "m"),
      number("max_normal_angle", pairs.max_normal_angle, above(0.0), "rad"),
      number("surface_roughness", pairs.surface_roughness, atLeast(0.0), "m"),
      number("point_std", pairs.point_std, above(0.0), "m"),
      number("robust_width", pairs.robust_width, above(0.0)),
      number("observable_max_std", estimation.observability.max_std, above(0.0), "m"),
      number("observable_min_information_ratio", estimation.observability.min_information_ratio, atLeast(0.0)),
      number("correlated_beams", estimation.correlated_beams, within(1, 10000), "beams"),
  };
}

}  // namespace

std::vector<Parameter> parameterList(Options& options) {
  List all = nodeParameters(options.node);
  for (const List& list : {odometryParameters(options.pipeline), estimationParameters(options.pipeline),
                           scanParameters(options.pipeline.scan), matcherParameters(options.pipeline.matcher)}) {
    all.insert(all.end(), list.begin(), list.end());
  }
  return all;
}

}  // namespace sckf
