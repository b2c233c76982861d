// The node that stands alone; see ScKfOdometryNode.
#include "sckf_odometry/ros/sckf_odometry_node.h"

#include <ros/ros.h>

#include <cstdlib>
#include <exception>

int main(int argc, char** argv) {
  ros::init(argc, argv, "sckf_odometry");
  const ros::NodeHandle keeps_the_log;  // with the last one roscpp's log ends, before it is said what was wrong
  try {
    const sckf::ScKfOdometryNode node(ros::NodeHandle(), ros::NodeHandle("~"));
    ros::spin();
  } catch (const std::exception& exception) {
    ROS_FATAL("not started: %s", exception.what());
    return EXIT_FAILURE;
  }
  return EXIT_SUCCESS;
}
