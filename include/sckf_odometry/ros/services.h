// What can be asked of the running node.
#pragma once

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <ros/subscriber.h>

#include <functional>
#include <string>
#include <vector>

namespace sckf {

/// The services ~reset, ~set_pose, ~pause and ~resume, and the topic set_pose.
class Services {
 public:
  struct Actions {
    /// Whether it has been done, and what there is to say.
    struct Answer {
      bool success;
      std::string message;
    };
    std::function<void()> reset;
    std::function<Answer(const geometry_msgs::PoseWithCovarianceStamped&)> set_pose;
    std::function<void(bool paused)> pause;
  };

  Services(ros::NodeHandle nh, ros::NodeHandle private_nh, const Actions& actions);

 private:
  std::vector<ros::ServiceServer> servers_;
  ros::Subscriber pose_subscriber_;
};

}  // namespace sckf
