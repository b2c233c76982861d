// Runs the package in this process, so that a sanitizer and a look at its memory see it.
#pragma once

#include <nodelet/loader.h>
#include <ros/ros.h>

#include <memory>
#include <stdexcept>

#include "sckf_odometry/ros/sckf_odometry_node.h"

namespace sckf::test {

class Host {
 public:
  static constexpr char kName[] = "/sckf_odometry";

  /// The nodelet, loaded as a manager does, with its parameters in kName; or the node's class with so many threads that
  /// call back at a time.
  explicit Host(bool nodelet, uint32_t threads) : spinner_(nodelet ? 1 : threads) {
    if (nodelet) {
      loader_ = std::make_unique<nodelet::Loader>();
      if (!loader_->load(kName, "sckf_odometry/ScKfOdometryNodelet", {}, {})) throw std::runtime_error("no nodelet");
    } else {
      node_ = std::make_unique<ScKfOdometryNode>(ros::NodeHandle(), ros::NodeHandle(kName));
    }
    spinner_.start();
  }

 private:
  std::unique_ptr<nodelet::Loader> loader_;
  std::unique_ptr<ScKfOdometryNode> node_;
  ros::AsyncSpinner spinner_;  // the first to go
};

}  // namespace sckf::test
