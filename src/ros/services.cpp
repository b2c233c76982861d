#include "sckf_odometry/ros/services.h"

#include <std_srvs/Empty.h>
#include <std_srvs/SetBool.h>

#include "sckf_odometry/SetPose.h"

namespace sckf {

namespace {

template <typename Service>
ros::ServiceServer advertise(
    ros::NodeHandle& nh, const std::string& name,
    const std::function<void(typename Service::Request&, typename Service::Response&)>& serve) {
  using Callback = boost::function<bool(typename Service::Request&, typename Service::Response&)>;
  const Callback callback = [serve](typename Service::Request& request, typename Service::Response& response) {
    serve(request, response);
    return true;
  };
  return nh.advertiseService(name, callback);
}

}  // namespace

Services::Services(ros::NodeHandle nh, ros::NodeHandle private_nh, const Actions& actions) {
  servers_.push_back(advertise<std_srvs::Empty>(
      private_nh, "reset", [actions](std_srvs::Empty::Request&, std_srvs::Empty::Response&) { actions.reset(); }));
  servers_.push_back(advertise<sckf_odometry::SetPose>(
      private_nh, "set_pose",
      [actions](sckf_odometry::SetPose::Request& request, sckf_odometry::SetPose::Response& response) {
        const Actions::Answer answer = actions.set_pose(request.pose);
        response.success = answer.success;
        response.message = answer.message;
      }));
  const auto advertisePause = [&](const std::string& name, bool paused_if_true) {
    servers_.push_back(advertise<std_srvs::SetBool>(
        private_nh, name,
        [actions, paused_if_true](std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
          const bool paused = static_cast<bool>(request.data) == paused_if_true;
          actions.pause(paused);
          response.success = true;
          response.message = paused ? "paused" : "running";
        }));
  };
  advertisePause("pause", true);
  advertisePause("resume", false);
  using Pose = geometry_msgs::PoseWithCovarianceStamped;
  const boost::function<void(const Pose::ConstPtr&)> take = [actions](const Pose::ConstPtr& message) {
    actions.set_pose(*message);
  };
  pose_subscriber_ = nh.subscribe<Pose>("set_pose", 1, take);
}

}  // namespace sckf
