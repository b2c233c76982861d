#include <nodelet/nodelet.h>

#include <exception>
#include <memory>
#include <pluginlib/class_list_macros.hpp>

#include "sckf_odometry/ros/sckf_odometry_node.h"

namespace sckf {

class ScKfOdometryNodelet : public nodelet::Nodelet {
 private:
  void onInit() override {
    try {
      node_ = std::make_unique<ScKfOdometryNode>(getNodeHandle(), getPrivateNodeHandle());
    } catch (const std::exception& exception) {
      // The manager and the others in it live on; this nodelet stays idle.
      NODELET_FATAL("not started: %s", exception.what());
    }
  }

  std::unique_ptr<ScKfOdometryNode> node_;
};

}  // namespace sckf

PLUGINLIB_EXPORT_CLASS(sckf::ScKfOdometryNodelet, nodelet::Nodelet)
