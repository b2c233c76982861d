// The parameters of the package: one list that ties a name to a field, a unit and what is allowed.
#pragma once

#include <limits>
#include <map>
#include <string>
#include <variant>
#include <vector>

#include "sckf_odometry/matching/point_cloud.h"
#include "sckf_odometry/pipeline/scan_odometry.h"
#include "sckf_odometry/ros/parameter_source.h"

namespace sckf {

/// What only the ROS layer needs to know.
struct NodeOptions {
  std::vector<std::string> scan_topics{"scan"};  ///< one for each laser
  std::string odom_frame = "odom";               ///< frame of the estimate
  std::string base_frame = "base_link";          ///< frame of the robot
  bool publish_tf = true;                        ///< publish odom_frame → base_frame on TF
  bool invert_odom_tf = false;    ///< publish base_frame → odom_frame: where base_frame has another parent already
  std::string map_frame = "map";  ///< frame of absolute poses
  bool publish_map_tf = false;    ///< publish map_frame → odom_frame on TF, where absolute poses are used
  bool use_tf_odometry = false;   ///< read wheel odometry from TF instead of the topic odom
  std::string tf_odometry_frame = "odom";  ///< frame of the wheel odometry on TF
  bool use_cloud_input = false;            ///< take clouds of points instead of scans
  CloudOptions cloud_input;                ///< … and these of their points
  std::size_t queue_size = 2000;           ///< messages per subscription that may wait
  double time_jump = 1.0;                  ///< [s] odometry that goes back by more starts a new estimate
  double scan_timeout = 2.0;               ///< [s] no scan for longer is worth a warning
  std::string state_file;                  ///< where the last pose is kept for a restart of the node; empty: nowhere
  double state_max_age = 60.0;             ///< [s] an older pose is not taken up
  double visualization_rate = 2.0;         ///< [1/s] of wall time, at which paths and cloud are published
  double path_distance = 0.05;             ///< [m] between two poses of a path
  std::size_t path_max_poses = 10000;      ///< a path that grows longer is thinned to half
  double cloud_resolution = 0.05;          ///< [m] one point in a square of this size
  std::size_t cloud_max_points = 200000;   ///< beyond, the oldest points are forgotten
};

/// scan_topics; of clouds, where it is at its default, cloud_in.
std::vector<std::string> rangeTopics(const NodeOptions& options);

/// resolved: what each of `topics` is in the end. Throws std::invalid_argument, by name, if two are the same: each scan
/// would be used twice.
void checkTopics(const std::vector<std::string>& topics, const std::vector<std::string>& resolved);

/// Everything that can be set from outside.
struct Options {
  PipelineOptions pipeline;
  NodeOptions node;
};

/// The numbers that a parameter may have; the bounds belong to it unless they are excluded.
struct Range {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool min_excluded = false;
  bool max_excluded = false;

  bool contains(double value) const;  ///< false for what is not finite
  std::string text() const;           ///< "in (0, 1]", "at least 0", …
};

struct Parameter {
  using Field = std::variant<bool*, int*, std::size_t*, double*, std::string*, std::vector<std::string>*>;

  std::string name;
  Field field;
  Range range;                       ///< of a number
  std::string unit;                  ///< of a number, empty if it has none
  std::vector<std::string> choices;  ///< of a text; empty: any
  bool may_be_empty = false;         ///< a text
  bool at_run_time = false;          ///< it can be changed while the node runs: it is in cfg/ScKfOdometry.cfg too
};

/// Every parameter of the package, its field in the options given.
std::vector<Parameter> parameterList(Options& options);

/// Names that other packages have for a parameter, and its name here.
const std::map<std::string, std::string>& parameterAliases();

/// The options given, with what the source sets. What it says to no effect, or by another package's name, goes to
/// `warnings`, where that is not null, a line for each.
/// Throws std::invalid_argument with one line for each bad value: parameter, value, what is allowed.
Options readOptions(const ParameterSource& source, std::vector<std::string>* warnings = nullptr, Options options = {});

}  // namespace sckf
