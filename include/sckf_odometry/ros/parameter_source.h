// Where parameters come from: the parameter server, or a file.
#pragma once

#include <ros/node_handle.h>

#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace sckf {

struct ParameterValue {
  using Other = std::monostate;  ///< what no parameter of the package can be
  using Texts = std::vector<std::string>;

  std::variant<Other, bool, int, double, std::string, Texts> value;
  std::string text;  ///< as it is shown to the user
};

/// Names and values; those of a group inside come as "group/name".
class ParameterSource {
 public:
  virtual ~ParameterSource() = default;
  virtual std::map<std::string, ParameterValue> values() const = 0;
};

/// The private namespace of a node or nodelet.
class ParameterServer : public ParameterSource {
 public:
  explicit ParameterServer(const ros::NodeHandle& private_nh) : private_nh_(private_nh) {}
  std::map<std::string, ParameterValue> values() const override;

 private:
  ros::NodeHandle private_nh_;
};

/// A file as rosparam loads it. Throws std::invalid_argument if it cannot be read.
class ParameterFile : public ParameterSource {
 public:
  explicit ParameterFile(const std::string& path);
  std::map<std::string, ParameterValue> values() const override { return values_; }

 private:
  std::map<std::string, ParameterValue> values_;
};

}  // namespace sckf
