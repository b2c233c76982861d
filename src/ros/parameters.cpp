#include "sckf_odometry/ros/parameters.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "sckf_odometry/ros/conversions.h"

namespace sckf {

namespace {

bool isList(const Parameter& parameter) { return std::holds_alternative<std::vector<std::string>*>(parameter.field); }

bool isNumber(const Parameter& parameter) {
  return !std::holds_alternative<bool*>(parameter.field) && !std::holds_alternative<std::string*>(parameter.field) &&
         !isList(parameter);
}

bool isWhole(const Parameter& parameter) {
  return std::holds_alternative<int*>(parameter.field) || std::holds_alternative<std::size_t*>(parameter.field);
}

std::string expectation(const Parameter& parameter) {
  if (std::holds_alternative<bool*>(parameter.field)) return "true or false";
  if (isList(parameter)) return "a list of texts, of which none is empty and none comes twice,";
  if (!isNumber(parameter)) {
    if (parameter.choices.empty()) return parameter.may_be_empty ? "a text" : "a text that is not empty";
    std::string text = "one of";
    for (const std::string& choice : parameter.choices) text += " \"" + choice + "\"";
    return text;
  }
  const std::string unit = parameter.unit.empty() ? "" : " " + parameter.unit;
  return (isWhole(parameter) ? "a whole number " : "a number ") + parameter.range.text() + unit;
}

/// A number that YAML 1.1 takes for a text, as 1e-3 without a point, is still a number.
std::optional<double> number(const ParameterValue& value) {
  if (const auto* whole = std::get_if<int>(&value.value)) return *whole;
  if (const auto* real = std::get_if<double>(&value.value)) return *real;
  if (const auto* text = std::get_if<std::string>(&value.value)) {
    std::istringstream stream(*text);
    double real = 0.0;
    if (stream >> real && stream.eof()) return real;
  }
  return std::nullopt;
}

bool assign(const Parameter& parameter, const ParameterValue& value) {
  if (const auto* field = std::get_if<bool*>(&parameter.field)) {
    const bool* flag = std::get_if<bool>(&value.value);
    if (flag != nullptr) **field = *flag;
    return flag != nullptr;
  }
  if (const auto* field = std::get_if<std::string*>(&parameter.field)) {
    const auto* text = std::get_if<std::string>(&value.value);
    if (text == nullptr || (text->empty() && !parameter.may_be_empty)) return false;
    const auto& choices = parameter.choices;
    if (!choices.empty() && std::find(choices.begin(), choices.end(), *text) == choices.end()) return false;
    **field = *text;
    return true;
  }
  if (const auto* field = std::get_if<std::vector<std::string>*>(&parameter.field)) {
    const auto* texts = std::get_if<ParameterValue::Texts>(&value.value);
    const bool sensible = texts != nullptr && !texts->empty() &&
                          std::find(texts->begin(), texts->end(), "") == texts->end() &&
                          std::set<std::string>(texts->begin(), texts->end()).size() == texts->size();
    if (sensible) **field = *texts;
    return sensible;
  }
  if (isWhole(parameter) && !std::holds_alternative<int>(value.value)) return false;
  const std::optional<double> real = number(value);
  if (!real || !parameter.range.contains(*real)) return false;
  if (const auto* field = std::get_if<int*>(&parameter.field)) **field = static_cast<int>(*real);
  if (const auto* field = std::get_if<std::size_t*>(&parameter.field)) **field = static_cast<std::size_t>(*real);
  if (const auto* field = std::get_if<double*>(&parameter.field)) **field = *real;
  return true;
}

using Values = std::map<std::string, ParameterValue>;

/// Gives what is set by another package's name the name that it has here, unless that is set too.
void resolveAliases(Values& values, std::vector<std::string>& warnings) {
  for (const auto& [alias, name] : parameterAliases()) {
    const auto given = values.find(alias);
    if (given == values.end()) continue;
    const auto [ours, taken] = values.emplace(name, given->second);
    warnings.push_back("parameter " + alias + " = " + given->second.text + ": it is called " + name + " here" +
                       (taken ? "" : ", and is set to " + ours->second.text + ", which holds"));
    values.erase(given);
  }
}

/// The number of letters to insert, to drop or to exchange to make one word the other.
std::size_t editDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t exchanged = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = std::exchange(row[j], std::min({row[j] + 1, row[j - 1] + 1, exchanged}));
    }
  }
  return row.back();
}

/// The parameter that a misspelt name is nearest to; empty if it is near to none.
std::string nearestName(const std::string& name, const std::vector<Parameter>& parameters) {
  std::string nearest;
  std::size_t distance = std::max<std::size_t>(2, name.size() / 3) + 1;
  for (const Parameter& parameter : parameters) {
    const std::size_t d = editDistance(name, parameter.name);
    if (d >= distance) continue;
    distance = d;
    nearest = parameter.name;
  }
  return nearest;
}

/// What no parameter says alone.
void checkTogether(const Options& options, std::vector<std::string>& problems) {
  const ScanOptions& scan = options.pipeline.scan;
  const NodeOptions& node = options.node;
  const auto ordered = [&problems](const std::string& low_name, double low, const std::string& high_name, double high) {
    std::ostringstream text;
    text << low_name << " = " << low << ": less than " << high_name << " = " << high << " expected";
    if (low >= high) problems.push_back(text.str());
  };
  ordered("range_min", scan.range_min, "range_max", scan.range_max);
  ordered("cloud_height_min", node.cloud_input.height_min, "cloud_height_max", node.cloud_input.height_max);
  ordered("cloud_range_min", node.cloud_input.range_min, "cloud_range_max", node.cloud_input.range_max);
  ordered("range_noise_min", scan.range_noise_min, "range_noise_max", scan.range_noise_max);
  if (node.scan_topics.size() > 1 && options.pipeline.method != "sckf_multi") {
    problems.push_back("scan_topics has " + std::to_string(node.scan_topics.size()) +
                       " topics: one expected with method \"" + options.pipeline.method +
                       "\", more only with \"sckf_multi\"");
  }
  const CornerOptions& corner = options.pipeline.landmarks.corner;
  ordered("corner_min_length", corner.min_length, "corner_max_length", corner.max_length);
  if (node.odom_frame == node.base_frame) {
    problems.push_back("odom_frame = \"" + node.odom_frame + "\": another frame than base_frame expected");
  }
  if (node.map_frame == node.odom_frame || node.map_frame == node.base_frame) {
    problems.push_back("map_frame = \"" + node.map_frame + "\": another frame than odom_frame and base_frame expected");
  }
  if (node.publish_map_tf && !options.pipeline.pose_updates.on) {
    problems.push_back("publish_map_tf = true: only with use_pose_updates = true, which gives it something to publish");
  }
  if (node.use_tf_odometry && node.tf_odometry_frame == node.base_frame) {
    problems.push_back("tf_odometry_frame = \"" + node.tf_odometry_frame +
                       "\": another frame than base_frame expected");
  }
}

}  // namespace

std::vector<std::string> rangeTopics(const NodeOptions& options) {
  const bool is_default = options.scan_topics == NodeOptions().scan_topics;
  return options.use_cloud_input && is_default ? std::vector<std::string>{"cloud_in"} : options.scan_topics;
}

void checkTopics(const std::vector<std::string>& topics, const std::vector<std::string>& resolved) {
  for (std::size_t i = 0; i < resolved.size(); ++i) {
    const auto same = std::find(resolved.begin(), resolved.begin() + static_cast<std::ptrdiff_t>(i), resolved[i]);
    const auto first = static_cast<std::size_t>(same - resolved.begin());
    if (first == i) continue;
    throw std::invalid_argument("scan_topics has \"" + topics[first] + "\" and \"" + topics[i] + "\": both are " +
                                resolved[i] + ", topics of which none comes twice expected");
  }
}

bool Range::contains(double value) const {
  if (!std::isfinite(value)) return false;
  return (min_excluded ? value > min : value >= min) && (max_excluded ? value < max : value <= max);
}

std::string Range::text() const {
  std::ostringstream text;
  if (std::isinf(max)) {
    text << (min_excluded ? "above " : "of at least ") << min;
  } else {
    text << "in " << (min_excluded ? "(" : "[") << min << ", " << max << (max_excluded ? ")" : "]");
  }
  return text.str();
}

Options readOptions(const ParameterSource& source, std::vector<std::string>* warnings, Options options) {
  std::vector<std::string> problems;
  std::vector<std::string> remarks;
  Values values = source.values();
  resolveAliases(values, remarks);
  const std::vector<Parameter> parameters = parameterList(options);
  for (const Parameter& parameter : parameters) {
    const auto given = values.find(parameter.name);
    if (given == values.end()) continue;
    if (!assign(parameter, given->second)) {
      problems.push_back(parameter.name + " = " + given->second.text + ": " + expectation(parameter) + " expected");
    }
    values.erase(given);
  }
  for (const auto& [name, value] : values) {
    const std::string nearest = nearestName(name, parameters);
    remarks.push_back("unknown parameter " + name + ": no effect; " +
                      (nearest.empty() ? "the names are in config/sckf_odometry.yaml" : "is " + nearest + " meant?"));
  }
  if (warnings != nullptr) *warnings = remarks;
  NodeOptions& node = options.node;
  for (std::string* frame : {&node.odom_frame, &node.base_frame, &node.map_frame, &node.tf_odometry_frame})
    *frame = frameName(*frame);
  options.pipeline.lasers = node.scan_topics.size();
  checkTogether(options, problems);
  if (problems.empty()) return options;
  std::string text = "bad parameters:";
  for (const std::string& problem : problems) text += "\n  " + problem;
  throw std::invalid_argument(text);
}

}  // namespace sckf
