#include "sckf_odometry/pipeline/pipeline_options.h"

#include <stdexcept>

namespace sckf {

namespace {

void checkMethod(const std::string& method) {
  if (makeFusionMethod(method, SE2(), Eigen::Matrix3d::Zero())) return;
  std::string known;
  for (const std::string& name : fusionMethodNames()) known += (known.empty() ? "" : ", ") + name;
  throw std::invalid_argument("method is \"" + method + "\": expected one of " + known);
}

/// What is on has to be there: other methods have no states but the pose.
void checkStates(const PipelineOptions& options) {
  const auto refuse = [&options](const std::string& parameter, const std::string& expected) {
    throw std::invalid_argument(parameter + ": expected " + expected + " with method \"" + options.method +
                                "\"; only \"sckf_multi\" has states beside the pose");
  };
  if (options.method == "sckf_multi") return;
  if (options.imu.gyro) refuse("use_imu is true", "false");
  if (options.imu.orientation) refuse("use_imu_orientation is true", "false");
  if (options.pose_updates.on) refuse("use_pose_updates is true", "false");
  if (options.standstill.time > 0.0) refuse("standstill_time is " + std::to_string(options.standstill.time), "0");
  if (options.landmarks.on()) refuse("landmarks is \"" + options.landmarks.use + "\"", "\"none\"");
}

void checkLasers(const PipelineOptions& options) {
  if (options.lasers == 1 || (options.lasers > 1 && options.method == "sckf_multi")) return;
  throw std::invalid_argument("there are " + std::to_string(options.lasers) + " lasers, and method is \"" +
                              options.method + "\": expected one laser, or more and method \"sckf_multi\"");
}

void checkLandmarks(const PipelineOptions& options) {
  if (!options.landmarks.only || options.landmarks.on()) return;
  throw std::invalid_argument("landmarks_only is true: expected false with landmarks \"none\"");
}

}  // namespace

void check(const PipelineOptions& options) {
  checkMethod(options.method);
  checkStates(options);
  modelledIncrement(SE2(), options.odometry_noise);  // throws if there is no such model
  checkLasers(options);
  checkLandmarks(options);
}

void checkChange(const PipelineOptions& from, const PipelineOptions& to) {
  if (to.lasers != from.lasers) {
    throw std::invalid_argument("there are " + std::to_string(to.lasers) + " lasers: expected " +
                                std::to_string(from.lasers) + ", which only a new estimate can change");
  }
  if (to.method != from.method) {
    throw std::invalid_argument("method is \"" + to.method + "\": expected \"" + from.method +
                                "\", which only a new estimate can change");
  }
  check(to);
}

}  // namespace sckf
