// Another package of ROS that uses the pipeline in a program of its own: half a metre by the wheels.
#include <sckf_odometry/pipeline/scan_odometry.h>
#include <sckf_odometry/ros/conversions.h>

#include <iostream>

int main() {
  sckf::ScanOdometry pipeline({});
  for (const double x : {0.0, 0.5}) {
    sckf::OdometrySample sample;
    sample.stamp = std::chrono::milliseconds(1000000 + static_cast<int>(1000.0 * x));
    sample.odom_from_base = sckf::SE2(x, 0.0, 0.0);
    pipeline.addOdometry(sample);
  }
  std::cout << sckf::toOdometryMessage(*pipeline.latest(), "odom", "base_link").pose.pose.position.x << '\n';
}
