#include "sckf_odometry/ros/parameter_source.h"

#include <XmlRpcValue.h>
#include <ros/param.h>

#include <algorithm>
#include <sstream>
#include <stdexcept>

#include "yaml_file.h"

namespace sckf {

namespace {

using Values = std::map<std::string, ParameterValue>;

std::string joined(const std::string& group, const std::string& name) {
  return group.empty() ? name : group + "/" + name;
}

/// As a user would write it.
std::string shown(const ParameterValue::Texts& texts) {
  std::string all;
  for (const std::string& text : texts) all += (all.empty() ? "" : ", ") + text;
  return "[" + all + "]";
}

/// A number that is not meant as a whole one keeps its point.
std::string shown(double value) {
  std::ostringstream text;
  text << value;
  return text.str().find_first_of(".en") == std::string::npos ? text.str() + ".0" : text.str();
}

std::string shown(XmlRpc::XmlRpcValue& node) {
  if (node.getType() == XmlRpc::XmlRpcValue::TypeArray) {
    ParameterValue::Texts entries;
    for (int i = 0; i < node.size(); ++i) entries.push_back(shown(node[i]));
    return shown(entries);
  }
  if (node.getType() == XmlRpc::XmlRpcValue::TypeString) return "\"" + static_cast<std::string&>(node) + "\"";
  if (node.getType() == XmlRpc::XmlRpcValue::TypeDouble) return shown(static_cast<double&>(node));
  if (node.getType() == XmlRpc::XmlRpcValue::TypeBoolean) return static_cast<bool&>(node) ? "true" : "false";
  std::ostringstream text;
  node.write(text);
  return text.str();
}

ParameterValue list(XmlRpc::XmlRpcValue& node) {
  ParameterValue::Texts texts;
  for (int i = 0; i < node.size(); ++i) {
    if (node[i].getType() != XmlRpc::XmlRpcValue::TypeString) return {ParameterValue::Other(), shown(node)};
    texts.push_back(static_cast<std::string&>(node[i]));
  }
  return {texts, shown(texts)};
}

void collect(const std::string& name, XmlRpc::XmlRpcValue& node, Values& values) {
  switch (node.getType()) {
    case XmlRpc::XmlRpcValue::TypeStruct:
      for (auto& [key, member] : node) collect(joined(name, key), member, values);
      break;
    case XmlRpc::XmlRpcValue::TypeBoolean:
      values[name] = {static_cast<bool&>(node), shown(node)};
      break;
    case XmlRpc::XmlRpcValue::TypeInt:
      values[name] = {static_cast<int&>(node), shown(node)};
      break;
    case XmlRpc::XmlRpcValue::TypeDouble:
      values[name] = {static_cast<double&>(node), shown(node)};
      break;
    case XmlRpc::XmlRpcValue::TypeString:
      values[name] = {static_cast<std::string&>(node), shown(node)};
      break;
    case XmlRpc::XmlRpcValue::TypeArray:
      values[name] = list(node);
      break;
    default:
      values[name] = {ParameterValue::Other(), shown(node)};
  }
}

/// A plain scalar has the type that rosparam (YAML 1.1) gives it; only quoted ones are texts in any case.
ParameterValue scalar(const YAML::Node& node) {
  const std::string text = node.Scalar();
  const bool quoted = node.Tag() == "!";
  static const std::vector<std::string> kTrue{"true", "True", "TRUE", "yes", "Yes", "YES", "on", "On", "ON"};
  static const std::vector<std::string> kFalse{"false", "False", "FALSE", "no", "No", "NO", "off", "Off", "OFF"};
  if (!quoted) {
    if (std::find(kTrue.begin(), kTrue.end(), text) != kTrue.end()) return {true, text};
    if (std::find(kFalse.begin(), kFalse.end(), text) != kFalse.end()) return {false, text};
    int whole = 0;
    if (YAML::convert<int>::decode(node, whole)) return {whole, text};
    double number = 0.0;
    if (YAML::convert<double>::decode(node, number)) return {number, text};
  }
  return {text, "\"" + text + "\""};
}

ParameterValue list(const YAML::Node& node) {
  ParameterValue::Texts texts;
  for (const YAML::Node& entry : node) {
    const ParameterValue value = entry.IsScalar() ? scalar(entry) : ParameterValue();
    if (!std::holds_alternative<std::string>(value.value)) return {ParameterValue::Other(), YAML::Dump(node)};
    texts.push_back(entry.Scalar());
  }
  return {texts, shown(texts)};
}

void collect(const std::string& name, const YAML::Node& node, Values& values) {
  if (node.IsMap()) {
    for (const auto& entry : node) collect(joined(name, entry.first.as<std::string>()), entry.second, values);
  } else if (node.IsScalar()) {
    values[name] = scalar(node);
  } else {
    values[name] = list(node);
  }
}

}  // namespace

std::map<std::string, ParameterValue> ParameterServer::values() const {
  Values values;
  XmlRpc::XmlRpcValue root;
  if (private_nh_.getParam(private_nh_.getNamespace(), root) && root.getType() == XmlRpc::XmlRpcValue::TypeStruct) {
    collect("", root, values);
  }
  return values;
}

ParameterFile::ParameterFile(const std::string& path) {
  try {
    const YAML::Node root = loadYamlFile(path);
    if (!root.IsMap() && !root.IsNull()) throw YAML::Exception(root.Mark(), "not a list of \"name: value\"");
    if (root.IsMap()) collect("", root, values_);
  } catch (const std::exception& exception) {  // of yaml-cpp, or of the system
    throw std::invalid_argument("parameter file " + path + ": " + exception.what());
  }
}

}  // namespace sckf
