#include "sckf_odometry/ros/debug_view.h"

#include <sensor_msgs/PointCloud2.h>

#include "sckf_odometry/ros/conversions.h"
#include "sckf_odometry/ros/landmark_markers.h"

namespace sckf {

namespace {

constexpr uint32_t kDebugQueue = 100;  // at fast replay many leave in one go

/// The scan drawn in odom; empty if there is none.
sensor_msgs::PointCloud2 toCloud(const PlacedScan& placed, Stamp stamp, const std::string& frame) {
  std::vector<Eigen::Vector2d> points;
  if (placed.scan) {
    for (const auto& seen : {placed.scan->points.point, placed.scan->set_aside}) {
      for (const Eigen::Vector2d& point : seen) points.push_back(placed.odom_from_base * point);
    }
  }
  return toPointCloud(points, stamp, frame);
}

template <typename Build>
void publishIfWatched(const ros::Publisher& publisher, const Build& build) {
  if (publisher.getNumSubscribers() > 0) publisher.publish(build());
}

}  // namespace

DebugView::DebugView(ros::NodeHandle nh, const NodeOptions& options)
    : odom_frame_(options.odom_frame),
      markers_(nh.advertise<visualization_msgs::MarkerArray>("debug/markers", kDebugQueue)),
      landmarks_(nh.advertise<visualization_msgs::MarkerArray>("landmarks", kDebugQueue)) {
  for (std::size_t laser = 0; laser < rangeTopics(options).size(); ++laser) {
    const std::string number = laser == 0 ? "" : "_" + std::to_string(laser + 1);
    lasers_.push_back({nh.advertise<sensor_msgs::PointCloud2>("debug/reference_scan" + number, kDebugQueue),
                       nh.advertise<sensor_msgs::PointCloud2>("debug/aligned_scan" + number, kDebugQueue),
                       {}});
  }
}

void DebugView::show(const ScanReport& report) {
  if (!report.estimate) return;
  publish(report);
  if (report.new_reference) lasers_[report.laser].reference = {report.scan, report.estimate->odom_from_base};
}

void DebugView::publish(const ScanReport& report) const {
  const Laser& laser = lasers_[report.laser];
  const PlacedScan& reference = laser.reference;
  const bool compared = report.scan && reference.scan && report.reference_stamp == reference.scan->stamp;
  const PlacedScan aligned{report.scan, report.estimate->odom_from_base};
  // At the scan's stamp, all of them: the reference may be so old that TF has forgotten its time.
  publishIfWatched(laser.reference_scan,
                   [&] { return toCloud(compared ? reference : PlacedScan(), report.stamp, odom_frame_); });
  publishIfWatched(laser.aligned_scan,
                   [&] { return toCloud(compared ? aligned : PlacedScan(), report.stamp, odom_frame_); });
  publishIfWatched(markers_, [&] {
    return compared ? debugMarkers(report, reference, odom_frame_)
                    : noDebugMarkers(report.stamp, odom_frame_, report.laser);
  });
  publishIfWatched(landmarks_, [&] { return landmarkMarkers(report.landmarks, report.stamp, odom_frame_); });
}

}  // namespace sckf
