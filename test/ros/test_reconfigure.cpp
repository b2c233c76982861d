#include <gtest/gtest.h>

#include <map>

#include "sckf_odometry/ScKfOdometryConfig.h"
#include "sckf_odometry/ros/parameters.h"

namespace sckf {
namespace {

using sckf_odometry::ScKfOdometryConfig;

constexpr char kHint[] = "cfg/ScKfOdometry.cfg and src/ros/parameter_list.cpp differ";

/// What cfg/ScKfOdometry.cfg says of a parameter.
struct Entry {
  std::string type;
  std::string text = "";
  double value = 0.0;
  double min = 0.0;
  double max = 0.0;
};

std::map<std::string, double> numbers(const ScKfOdometryConfig& config) {
  dynamic_reconfigure::Config message;
  config.__toMessage__(message);
  std::map<std::string, double> numbers;
  for (const auto& entry : message.bools) numbers[entry.name] = entry.value ? 1.0 : 0.0;
  for (const auto& entry : message.ints) numbers[entry.name] = entry.value;
  for (const auto& entry : message.doubles) numbers[entry.name] = entry.value;
  return numbers;
}

std::map<std::string, Entry> configured() {
  const auto values = numbers(ScKfOdometryConfig::__getDefault__());
  const auto min = numbers(ScKfOdometryConfig::__getMin__());
  const auto max = numbers(ScKfOdometryConfig::__getMax__());
  dynamic_reconfigure::Config texts;
  ScKfOdometryConfig::__getDefault__().__toMessage__(texts);
  std::map<std::string, Entry> entries;
  for (const auto& entry : texts.strs) entries[entry.name] = {"str", entry.value};
  for (const auto& description : ScKfOdometryConfig::__getParamDescriptions__()) {
    const std::string& name = description->name;
    if (entries.count(name) != 0) continue;
    entries[name] = {description->type, "", values.at(name), min.at(name), max.at(name)};
  }
  return entries;
}

/// What the parameter list says of it.
Entry listed(const Parameter& parameter) {
  if (const auto* flag = std::get_if<bool*>(&parameter.field)) return {"bool", "", **flag ? 1.0 : 0.0, 0.0, 1.0};
  if (const auto* whole = std::get_if<int*>(&parameter.field)) {
    return {"int", "", static_cast<double>(**whole), parameter.range.min, parameter.range.max};
  }
  if (const auto* real = std::get_if<double*>(&parameter.field)) {
    return {"double", "", **real, parameter.range.min, parameter.range.max};
  }
  if (const auto* text = std::get_if<std::string*>(&parameter.field)) return {"str", **text};
  return {"a type that cannot change at run time"};
}

TEST(Reconfigure, TheConfigurationIsThatOfTheParameterList) {
  std::map<std::string, Entry> entries = configured();
  Options options;
  for (const Parameter& parameter : parameterList(options)) {
    const auto found = entries.find(parameter.name);
    ASSERT_EQ(found != entries.end(), parameter.at_run_time) << parameter.name << ": " << kHint;
    if (found == entries.end()) continue;
    const Entry expected = listed(parameter);
    EXPECT_EQ(found->second.type, expected.type) << parameter.name << ": " << kHint;
    EXPECT_EQ(found->second.text, expected.text) << parameter.name << ": " << kHint;
    EXPECT_EQ(found->second.value, expected.value) << parameter.name << ": " << kHint;
    EXPECT_EQ(found->second.min, expected.min) << parameter.name << ": " << kHint;
    EXPECT_EQ(found->second.max, expected.max) << parameter.name << ": " << kHint;
    entries.erase(found);
  }
  for (const auto& [name, entry] : entries) ADD_FAILURE() << name << ": " << kHint;
}

TEST(Reconfigure, WhatCannotChangeWhileItRunsIsNotInIt) {
  const auto entries = configured();
  for (const std::string name : {"odom_frame", "base_frame", "publish_tf", "method", "queue_size", "state_file"}) {
    EXPECT_EQ(entries.count(name), 0u) << name;
  }
}

}  // namespace
}  // namespace sckf
