#include "sckf_odometry/ros/state_file.h"

#include <ros/console.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <vector>

#include "sckf_odometry/core/covariance.h"
#include "sckf_odometry/ros/constants.h"
#include "yaml_file.h"

namespace sckf {

namespace {

constexpr char kContent[] = "odom_frame, base_frame, stamp [ns], pose [x, y, yaw], covariance [3 x 3]";

std::vector<double> numbers(const YAML::Node& node, std::size_t count) {
  auto values = node.as<std::vector<double>>();
  if (values.size() != count) throw std::runtime_error(std::to_string(count) + " numbers expected");
  return values;
}

SavedPose parse(const YAML::Node& root) {
  SavedPose saved;
  saved.odom_frame = root["odom_frame"].as<std::string>();
  saved.base_frame = root["base_frame"].as<std::string>();
  saved.stamp = Stamp(root["stamp"].as<Stamp::rep>());
  const std::vector<double> pose = numbers(root["pose"], 3);
  saved.odom_from_base = SE2(pose[0], pose[1], pose[2]);
  const std::vector<double> covariance = numbers(root["covariance"], 9);
  saved.covariance = Eigen::Map<const Eigen::Matrix3d>(covariance.data());
  const std::string problem = problemOf(saved.odom_from_base, saved.covariance);
  if (!problem.empty()) throw std::runtime_error(problem);
  return saved;
}

}  // namespace

std::optional<SavedPose> StateFile::read(std::string* problem) const {
  try {
    return parse(loadYamlFile(path_));
  } catch (const std::system_error& error) {
    if (error.code() != std::errc::no_such_file_or_directory) *problem = path_ + ": " + error.code().message();
    return std::nullopt;
  } catch (const std::exception& exception) {
    *problem = path_ + ": " + exception.what() + ": " + kContent + " expected";
    return std::nullopt;
  }
}

bool StateFile::write(const SavedPose& saved, std::string* problem) const {
  const std::string part = path_ + ".part";
  std::ofstream file(part);
  file.precision(std::numeric_limits<double>::max_digits10);
  const SE2& pose = saved.odom_from_base;
  const Eigen::IOFormat in_one_line(std::numeric_limits<double>::max_digits10, Eigen::DontAlignCols, ", ", ", ");
  file << "odom_frame: \"" << saved.odom_frame << "\"\nbase_frame: \"" << saved.base_frame
       << "\"\nstamp: " << saved.stamp.count() << "\npose: [" << pose.x << ", " << pose.y << ", " << pose.yaw
       << "]\ncovariance: [" << saved.covariance.format(in_one_line) << "]\n";
  file.close();
  if (file && std::rename(part.c_str(), path_.c_str()) == 0) return true;
  *problem = path_ + ": " + std::strerror(errno) + ": a file that can be written expected";
  return false;
}

PoseKeeper::PoseKeeper(const NodeOptions& options) : options_(options) {
  if (options.state_file.empty()) return;
  std::string problem;
  saved_ = StateFile(options.state_file).read(&problem);
  if (saved_ && (saved_->odom_frame != options.odom_frame || saved_->base_frame != options.base_frame)) {
    problem = options.state_file + ": a pose of " + saved_->base_frame + " in " + saved_->odom_frame + ": one of " +
              options.base_frame + " in " + options.odom_frame + " expected";
    saved_.reset();
  }
  if (!problem.empty()) ROS_WARN_STREAM_NAMED(kLogger, "~state_file not used: " << problem);
}

std::optional<SavedPose> PoseKeeper::takeUp(Stamp first_odometry) {
  if (!saved_) return std::nullopt;
  const std::optional<SavedPose> saved = std::exchange(saved_, std::nullopt);
  const double age = seconds(first_odometry - saved->stamp);
  if (age >= -options_.time_jump && age <= options_.state_max_age) {
    ROS_INFO_STREAM_NAMED(kLogger, "the estimate goes on where " << options_.state_file << " says");
    return saved;
  }
  ROS_WARN_STREAM_NAMED(kLogger, "~state_file not used: " << options_.state_file << ": its pose is " << age
                                                          << " s older than the odometry: 0 to "
                                                          << options_.state_max_age << " s expected (~state_max_age)");
  return std::nullopt;
}

std::string PoseKeeper::keep(const Estimate& estimate) {
  if (options_.state_file.empty() || saved_ || estimate.stamp == written_) return "";
  std::string problem;
  const SavedPose pose{options_.odom_frame, options_.base_frame, estimate.stamp, estimate.odom_from_base,
                       estimate.covariance};
  if (StateFile(options_.state_file).write(pose, &problem)) written_ = estimate.stamp;
  return problem;
}

}  // namespace sckf
