// The one list of all parameters. A new option needs a line here and its entry in config/sckf_odometry.yaml.
#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/core/odometry_model.h"
#include "sckf_odometry/ros/parameters.h"

namespace sckf {

namespace {

Range atLeast(double min) { return {min, Range().max, false, false}; }
Range above(double min) { return {min, Range().max, true, false}; }
Range aboveUpTo(double min, double max) { return {min, max, true, false}; }
Range within(double min, double max) { return {min, max, false, false}; }
Range strictlyWithin(double min, double max) { return {min, max, true, true}; }

Parameter flag(const std::string& name, bool& field) { return {name, &field, {}, "", {}}; }

Parameter text(const std::string& name, std::string& field, const std::vector<std::string>& choices = {}) {
  return {name, &field, {}, "", choices};
}

Parameter textOrNothing(const std::string& name, std::string& field) { return {name, &field, {}, "", {}, true}; }

template <typename Number>
Parameter number(const std::string& name, Number& field, const Range& range, const std::string& unit = "") {
  return {name, &field, range, unit, {}};
}

using List = std::vector<Parameter>;

List atRunTime(List list) {
  for (Parameter& parameter : list) parameter.at_run_time = true;
  return list;
}

List nodeParameters(NodeOptions& node) {
  return {
      {"scan_topics", &node.scan_topics, {}, "", {}},
      text("odom_frame", node.odom_frame),
      text("base_frame", node.base_frame),
      flag("publish_tf", node.publish_tf),
      flag("invert_odom_tf", node.invert_odom_tf),
      text("map_frame", node.map_frame),
      flag("publish_map_tf", node.publish_map_tf),
      flag("use_tf_odometry", node.use_tf_odometry),
      text("tf_odometry_frame", node.tf_odometry_frame),
      flag("use_cloud_input", node.use_cloud_input),
      number("queue_size", node.queue_size, within(1, 1e6), "messages"),
      number("time_jump", node.time_jump, above(0.0), "s"),
      textOrNothing("state_file", node.state_file),
      number("state_max_age", node.state_max_age, above(0.0), "s"),
      number("path_distance", node.path_distance, atLeast(0.0), "m"),
      number("path_max_poses", node.path_max_poses, within(2, 1e6), "poses"),
      number("cloud_resolution", node.cloud_resolution, within(0.001, 10.0), "m"),
      number("cloud_max_points", node.cloud_max_points, within(1, 1e7), "points"),
  };
}

List nodeParametersAtRunTime(NodeOptions& node) {
  CloudOptions& cloud = node.cloud_input;
  return {
      number("cloud_height_min", cloud.height_min, within(-100.0, 100.0), "m"),
      number("cloud_height_max", cloud.height_max, within(-100.0, 100.0), "m"),
      number("cloud_range_min", cloud.range_min, within(0.0, 1000.0), "m"),
      number("cloud_range_max", cloud.range_max, aboveUpTo(0.0, 1000.0), "m"),
      number("cloud_beams", cloud.beams, within(20, 1000000), "beams"),
      number("scan_timeout", node.scan_timeout, within(0.01, 3600.0), "s"),
      number("visualization_rate", node.visualization_rate, within(0.0, 100.0), "1/s"),
  };
}

List odometryParameters(PipelineOptions& pipeline) {
  OdometryNoise& noise = pipeline.odometry_noise;
  MotionLimits& motion = pipeline.motion;
  return {
      text("odometry_model", noise.model, odometryModelNames()),
      number("odometry_lateral_share", noise.lateral_share, within(0.0, 1.0)),
      number("odometry_translation_per_meter", noise.translation_per_meter, within(0.0, 10.0), "m/sqrt(m)"),
      number("odometry_translation_per_radian", noise.translation_per_radian, within(0.0, 10.0), "m/sqrt(rad)"),
      number("odometry_yaw_per_meter", noise.yaw_per_meter, within(0.0, 10.0), "rad/sqrt(m)"),
      number("odometry_yaw_per_radian", noise.yaw_per_radian, within(0.0, 10.0), "rad/sqrt(rad)"),
      flag("prefer_twist_covariance", pipeline.prefer_twist_covariance),
      number("twist_window", pipeline.twist_window, within(0.001, 60.0), "s"),
      number("odometry_timeout", pipeline.odometry_timeout, within(0.01, 3600.0), "s"),
      flag("scans_alone", pipeline.scans_alone),
      number("motion_max_speed", motion.max_speed, within(0.01, 100.0), "m/s"),
      number("motion_max_yaw_rate", motion.max_yaw_rate, within(0.01, 100.0), "rad/s"),
      number("motion_slack_translation", motion.slack_translation, within(0.0, 100.0), "m"),
      number("motion_slack_yaw", motion.slack_yaw, within(0.0, 100.0), "rad"),
      number("motion_unknown_speed_std", motion.unknown_speed_std, within(0.0, 100.0), "m/s"),
      number("motion_unknown_yaw_rate_std", motion.unknown_yaw_rate_std, within(0.0, 100.0), "rad/s"),
  };
}

/// Of a new estimate: they cannot change while there is one.
List otherSensors(PipelineOptions& pipeline) {
  CalibrationOptions& calibration = pipeline.calibration;
  ImuOptions& imu = pipeline.imu;
  StandstillOptions& standstill = pipeline.standstill;
  return {
      number("calibration_distance_std", calibration.distance_std, within(0.0, 1.0)),
      number("calibration_rotation_std", calibration.rotation_std, within(0.0, 1.0)),
      number("calibration_rotation_per_meter_std", calibration.rotation_per_meter_std, within(0.0, 1.0), "rad/m"),
      number("calibration_laser_ahead_std", calibration.laser_ahead_std, within(0.0, 1.0), "m"),
      number("calibration_floor_std", calibration.floor_std, within(0.0, 1.0), "m/m"),
      number("calibration_way", calibration.way, within(0.1, 1e6), "m"),
      flag("use_pose_updates", pipeline.pose_updates.on),
      number("pose_update_max_rejected", pipeline.pose_updates.max_rejected, within(1, 1e6), "poses"),
      flag("use_imu", imu.gyro),
      number("gyro_noise", imu.gyro_noise, aboveUpTo(0.0, 10.0), "rad/s/sqrt(Hz)"),
      number("gyro_bias_std", imu.gyro_bias_std, aboveUpTo(0.0, 10.0), "rad/s"),
      number("gyro_bias_drift", imu.gyro_bias_drift, within(0.0, 10.0), "rad/s/sqrt(s)"),
      flag("use_imu_orientation", imu.orientation),
      number("imu_orientation_std", imu.orientation_std, aboveUpTo(0.0, 10.0), "rad"),
      number("imu_heading_drift", imu.heading_drift, within(0.0, 10.0), "rad/sqrt(s)"),
      number("imu_timeout", imu.timeout, within(0.001, 60.0), "s"),
      number("standstill_time", standstill.time, within(0.0, 1e6), "s"),
      number("standstill_speed", standstill.speed, within(0.0, 10.0), "m/s"),
      number("standstill_yaw_rate", standstill.yaw_rate, within(0.0, 10.0), "rad/s"),
      number("standstill_std", standstill.std, aboveUpTo(0.0, 10.0), "m/sqrt(s), rad/sqrt(s)"),
  };
}

/// Of a new estimate.
List landmarkParameters(LandmarkOptions& landmarks) {
  CornerOptions& corner = landmarks.corner;
  LineOptions& line = landmarks.line;
  return {
      text("landmarks", landmarks.use, landmarkUses()),
      flag("landmarks_only", landmarks.only),
      number("landmarks_max", landmarks.max, within(1, 1000), "landmarks"),
      number("landmark_sightings", landmarks.sightings, within(2, 1000), "scans"),
      number("landmark_misses", landmarks.misses, within(1, 1000000), "scans"),
      number("landmark_max_share", landmarks.max_share, within(0.0, 1.0)),
      number("landmark_max_std", landmarks.max_std, aboveUpTo(0.0, 100.0), "m"),
      number("landmark_gate_probability", landmarks.probability, strictlyWithin(0.0, 1.0)),
      number("corner_min_length", corner.min_length, aboveUpTo(0.0, 100.0), "m"),
      number("corner_max_length", corner.max_length, aboveUpTo(0.0, 100.0), "m"),
      number("corner_min_points", corner.min_points, within(3, 1000), "points"),
      number("corner_roughness", corner.roughness, within(0.0, 10.0), "m"),
      number("corner_min_angle", corner.min_angle, within(0.1, 1.5), "rad"),
      number("corner_std_position", corner.std_position, within(0.0, 10.0), "m"),
      number("corner_std_yaw", corner.std_yaw, within(0.0, 10.0), "rad"),
      number("line_min_length", line.min_length, aboveUpTo(0.0, 100.0), "m"),
      number("line_min_points", line.min_points, within(3, 1000), "points"),
      number("line_points", line.points, within(3, 1000), "points"),
      number("line_roughness", line.roughness, within(0.0, 10.0), "m"),
      number("line_std_offset", line.std_offset, within(0.0, 10.0), "m"),
      number("line_std_yaw", line.std_yaw, within(0.0, 10.0), "rad"),
  };
}

List estimationParameters(PipelineOptions& pipeline) {
  ReferenceOptions& reference = pipeline.reference;
  GateOptions& gate = pipeline.gate;
  return {
      number("kf_dist_linear", reference.kf_dist_linear, within(0.0, 1000.0), "m"),
      number("kf_dist_angular", reference.kf_dist_angular, within(0.0, 1000.0), "rad"),
      number("kf_min_overlap", reference.kf_min_overlap, within(0.0, 1.0)),
      number("references_kept", reference.kept, within(1, 1000), "references"),
      number("older_references", reference.older_compared, within(0, 1000), "references"),
      number("older_dist_linear", reference.older_dist_linear, aboveUpTo(0.0, 1000.0), "m"),
      number("older_dist_angular", reference.older_dist_angular, aboveUpTo(0.0, 100.0), "rad"),
      number("older_min_overlap", reference.older_min_overlap, within(0.0, 1.0)),
      number("matching_common", reference.matching_common, within(0.0, 1000.0)),
      number("older_inflation", reference.older_inflation, within(1.0, 1000.0)),
      number("gate_probability", gate.probability, strictlyWithin(0.0, 1.0)),
      flag("trust_scans_on_slip", gate.trust_scans_on_slip),
      number("slip_std_translation", gate.slip_std_translation, within(0.0, 100.0), "m"),
      number("slip_std_yaw", gate.slip_std_yaw, within(0.0, 100.0), "rad"),
      number("slip_max_misfit", gate.slip_max_misfit, within(0.0, 3.0)),
      number("slip_min_overlap", gate.slip_min_overlap, within(0.0, 1.0)),
      number("doubtful_min_agreement", gate.doubtful_min_agreement, within(0.0, 1.0)),
      number("scan_patience", pipeline.scan_patience, within(0.0, 60.0), "s"),
      number("max_scan_delay", pipeline.max_scan_delay, aboveUpTo(0.0, 1e6), "s"),
      number("max_waiting_scans", pipeline.max_waiting_scans, within(1, 100000), "scans"),
  };
}

List scanParameters(PipelineOptions& pipeline) {
  ScanOptions& scan = pipeline.scan;
  return {
      flag("deskew", pipeline.deskew),
      number("range_min", scan.range_min, within(0.0, 1000.0), "m"),
      number("range_max", scan.range_max, aboveUpTo(0.0, 1000.0), "m"),
      number("range_noise_min", scan.range_noise_min, aboveUpTo(0.0, 10.0), "m"),
      number("range_noise_max", scan.range_noise_max, aboveUpTo(0.0, 10.0), "m"),
      number("range_offset_std", pipeline.range_offset_std, within(0.0, 1.0), "m"),
      number("sweep_duration_std", pipeline.sweep_duration_std, within(0.0, 1.0), "s"),
      number("min_points", scan.min_points, within(3, 1000000), "points"),
      number("surface_straightness", scan.surface.straightness, aboveUpTo(0.0, 1000.0)),
      number("surface_length", scan.surface.length, aboveUpTo(0.0, 1000.0), "m"),
      number("surface_max_normal_std", scan.surface.max_normal_std, aboveUpTo(0.0, 100.0), "rad"),
      number("max_beams", scan.max_beams, within(20, 1000000), "beams"),
  };
}

List matcherParameters(MatcherOptions& matcher) {
  PairOptions& pairs = matcher.pairs;
  EstimationOptions& estimation = matcher.estimation;
  return {
      number("icp_pair_distance", matcher.icp_pair_distance, aboveUpTo(0.0, 1000.0), "m"),
      number("max_iterations", matcher.max_iterations, within(1, 1000)),
      flag("match_both_ways", matcher.both_ways),
      number("prior_std_translation", matcher.prior_std_translation, aboveUpTo(0.0, 100.0), "m"),
      number("prior_std_yaw", matcher.prior_std_yaw, aboveUpTo(0.0, 100.0), "rad"),
      number("search_below_agreement", matcher.search_below_agreement, within(0.0, 1.0)),
      number("search_yaw_step", matcher.search_yaw_step, aboveUpTo(0.0, 10.0), "rad"),
      number("search_yaw_steps", matcher.search_yaw_steps, within(0, 1000)),
      number("wide_search_below_agreement", matcher.wide_search_below_agreement, within(0.0, 1.0)),
      number("wide_search_yaw", matcher.wide_search.yaw, within(0.0, 3.14), "rad"),
      number("wide_search_translation", matcher.wide_search.translation, within(0.0, 3.0), "m"),
      number("min_pairs", matcher.min_pairs, within(3, 1000000), "points"),
      number("min_overlap", matcher.min_overlap, within(0.0, 1.0)),
      number("min_agreement", matcher.min_agreement, within(0.0, 1.0)),
      number("moved_place_min_share", matcher.moved_place_min_share, within(0.0, 1.0)),
      number("max_refinement", matcher.max_refinement, aboveUpTo(0.0, 100.0), "m, rad"),
      number("max_correspondence_dist", pairs.max_distance, aboveUpTo(0.0, 100.0), "m"),
      number("max_normal_angle", pairs.max_normal_angle, aboveUpTo(0.0, 10.0), "rad"),
      number("normal_agreement", pairs.normal_agreement, aboveUpTo(0.0, 1000.0), "rad"),
      number("surface_roughness", pairs.surface_roughness, within(0.0, 10.0), "m"),
      number("point_std", pairs.point_std, aboveUpTo(0.0, 100.0), "m"),
      number("robust_width", pairs.robust_width, aboveUpTo(0.0, 1000.0)),
      number("observable_max_std", estimation.observability.max_std, aboveUpTo(0.0, 100.0), "m"),
      number("observable_min_information_ratio", estimation.observability.min_information_ratio, within(0.0, 1e6)),
      number("correlated_beams", estimation.correlated_beams, within(1, 10000), "beams"),
      number("matching_inflation", estimation.matching_inflation, within(0.0, 1000.0)),
      number("place_size", estimation.place_size, aboveUpTo(0.0, 100.0), "m"),
      number("place_std", estimation.place_std, within(0.0, 10.0), "m"),
  };
}

}  // namespace

std::vector<Parameter> parameterList(Options& options) {
  PipelineOptions& pipeline = options.pipeline;
  List all = nodeParameters(options.node);
  all.push_back(text("method", pipeline.method, fusionMethodNames()));
  const List other = otherSensors(pipeline);
  all.insert(all.end(), other.begin(), other.end());
  const List landmarks = landmarkParameters(pipeline.landmarks);
  all.insert(all.end(), landmarks.begin(), landmarks.end());
  for (const List& list :
       {nodeParametersAtRunTime(options.node), odometryParameters(pipeline), estimationParameters(pipeline),
        scanParameters(pipeline), matcherParameters(pipeline.matcher)}) {
    const List live = atRunTime(list);
    all.insert(all.end(), live.begin(), live.end());
  }
  return all;
}

const std::map<std::string, std::string>& parameterAliases() {
  static const std::map<std::string, std::string> kAliases{
      {"fixed_frame", "odom_frame"},      // laser_scan_matcher
      {"world_frame", "odom_frame"},      // robot_localization
      {"base_link_frame", "base_frame"},  // robot_localization
      {"invert_tf", "invert_odom_tf"},    // robot_localization
      {"odom_frame_id", "odom_frame"},    // rf2o, amcl
      {"base_frame_id", "base_frame"},    // rf2o, amcl
  };
  return kAliases;
}

}  // namespace sckf
