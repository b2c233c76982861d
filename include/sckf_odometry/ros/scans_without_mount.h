// Scans that wait until TF tells where their laser is on the robot.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "sckf_odometry/ros/range_message.h"
#include "sckf_odometry/ros/tf_input.h"

namespace sckf {

class ScansWithoutMount {
 public:
  struct Scan {
    std::size_t laser;
    RangeMessage message;
  };
  struct Mounted {
    Scan scan;
    Eigen::Isometry3d base_from_sensor;  ///< of the message's frame
  };

  void add(std::size_t laser, const RangeMessage& message) { waiting_.push_back({laser, message}); }

  /// Those whose mount TF knows by now, in the order in which they came.
  std::vector<Mounted> take(TfInput& tf);

  /// The laser of the one that has waited longest, which is dropped; empty if no more than so many wait.
  std::optional<std::size_t> giveUpBeyond(std::size_t most);

  void clear() { waiting_.clear(); }
  bool empty() const { return waiting_.empty(); }
  std::size_t size() const { return waiting_.size(); }

  /// What is missing on TF, in words, for the newest that waits.
  const std::string& problem() const { return problem_; }

 private:
  std::deque<Scan> waiting_;
  std::string problem_;
};

}  // namespace sckf
