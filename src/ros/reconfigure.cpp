#include "sckf_odometry/ros/reconfigure.h"

#include <ros/console.h>

#include <stdexcept>
#include <string>

#include "sckf_odometry/ros/constants.h"

namespace sckf {

namespace {

using sckf_odometry::ScKfOdometryConfig;

/// What a client asks for.
class ConfigSource : public ParameterSource {
 public:
  explicit ConfigSource(const ScKfOdometryConfig& config) { config.__toMessage__(message_); }

  std::map<std::string, ParameterValue> values() const override {
    std::map<std::string, ParameterValue> values;
    for (const auto& entry : message_.bools) {
      values[entry.name] = {static_cast<bool>(entry.value), entry.value ? "true" : "false"};
    }
    for (const auto& entry : message_.strs) values[entry.name] = {entry.value, "\"" + entry.value + "\""};
    for (const auto& entry : message_.ints) values[entry.name] = {entry.value, std::to_string(entry.value)};
    for (const auto& entry : message_.doubles) values[entry.name] = {entry.value, std::to_string(entry.value)};
    return values;
  }

 private:
  dynamic_reconfigure::Config message_;
};

ScKfOdometryConfig toConfig(Options options) {
  dynamic_reconfigure::Config message;
  for (const Parameter& parameter : parameterList(options)) {
    if (!parameter.at_run_time) continue;
    using dynamic_reconfigure::ConfigTools;
    if (const auto* flag = std::get_if<bool*>(&parameter.field)) {
      ConfigTools::appendParameter(message, parameter.name, **flag);
    } else if (const auto* whole = std::get_if<int*>(&parameter.field)) {
      ConfigTools::appendParameter(message, parameter.name, **whole);
    } else if (const auto* real = std::get_if<double*>(&parameter.field)) {
      ConfigTools::appendParameter(message, parameter.name, **real);
    } else if (const auto* text = std::get_if<std::string*>(&parameter.field)) {
      ConfigTools::appendParameter(message, parameter.name, **text);
    }
  }
  ScKfOdometryConfig config = ScKfOdometryConfig::__getDefault__();
  config.__fromMessage__(message);
  return config;
}

}  // namespace

Reconfigure::Reconfigure(const ros::NodeHandle& private_nh, const Options& options,
                         const std::function<void(const Options&)>& apply)
    : options_(options), apply_(apply), server_(mutex_, private_nh) {
  server_.updateConfig(toConfig(options));
  server_.setCallback([this](sckf_odometry::ScKfOdometryConfig& config, uint32_t) { onRequest(config); });
}

void Reconfigure::onRequest(sckf_odometry::ScKfOdometryConfig& config) {
  try {
    const Options changed = readOptions(ConfigSource(config), nullptr, options_);
    apply_(changed);
    options_ = changed;
  } catch (const std::invalid_argument& exception) {
    ROS_WARN_STREAM_NAMED(kLogger, "parameters not changed: " << exception.what());
    config = toConfig(options_);
  }
}

}  // namespace sckf
