// How each scan is compared with its reference, for rviz.
#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include <vector>

#include "sckf_odometry/ros/debug_markers.h"
#include "sckf_odometry/ros/parameters.h"

namespace sckf {

/// Publishes debug/reference_scan and debug/aligned_scan (sensor_msgs/PointCloud2) and debug/markers
/// (visualization_msgs/MarkerArray, see debugMarkers()), and landmarks (the same, see landmarkMarkers()), all in
/// odom_frame and at the scan's stamp; the scans of a second laser on debug/reference_scan_2 and debug/aligned_scan_2,
/// and so on. A topic to which nobody subscribes costs nothing.
class DebugView {
 public:
  DebugView(ros::NodeHandle nh, const NodeOptions& options);

  /// To be told of every scan, in order. One that was compared with nothing clears the view; one that was not used at
  /// all leaves it as it is.
  void show(const ScanReport& report);

 private:
  struct Laser {
    ros::Publisher reference_scan;
    ros::Publisher aligned_scan;
    PlacedScan reference;  // its scan is null before the first
  };

  void publish(const ScanReport& report) const;

  std::string odom_frame_;
  std::vector<Laser> lasers_;
  ros::Publisher markers_;
  ros::Publisher landmarks_;
};

}  // namespace sckf
