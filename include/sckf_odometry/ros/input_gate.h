// What is wrong with messages by themselves, and by their stamps: they are refused, counted, and it is said why.
#pragma once

#include <nav_msgs/Odometry.h>

#include <string>
#include <vector>

#include "sckf_odometry/ros/health.h"
#include "sckf_odometry/ros/parameters.h"
#include "sckf_odometry/ros/range_message.h"
#include "sckf_odometry/ros/stamp_guard.h"
#include "sckf_odometry/ros/tf_input.h"
#include "sckf_odometry/ros/warnings.h"

namespace sckf {

class InputGate {
 public:
  using Scan = RangeMessage;
  using Scans = StampGuard<Scan>::Admission;
  using Samples = StampGuard<OdometrySample>::Admission;

  /// odometry_source: a topic, or TF. scan_topics: one for each laser. health and warnings must live as long as the
  /// gate.
  InputGate(const NodeOptions& options, const std::string& odometry_source, const std::vector<std::string>& scan_topics,
            Health& health, Warnings& warnings);

  /// What of a laser, or of what else makes clouds, may be used now that the message has come.
  Scans admit(const sensor_msgs::LaserScan::ConstPtr& message, std::size_t laser = 0);
  Scans admit(const sensor_msgs::PointCloud2::ConstPtr& message, std::size_t laser = 0);

  /// The same of odometry from a topic; tf relates its frame to base_frame. What its twist covariance is worth is
  /// looked at where it would be used.
  Samples admit(const nav_msgs::Odometry& message, bool uses_twist_covariance, TfInput& tf);

  /// The same of odometry from TF.
  Samples admit(const OdometrySample& sample);

  /// kind: for the count, reason: value and what is expected.
  void refuseScan(std::size_t laser, const std::string& kind, const std::string& reason);
  void refuseOdometry(const std::string& kind, const std::string& reason);

  /// Time went back, as odometry or scans have told: the others will follow.
  void restart();

  Stamp newestOdometry() const { return odometry_stamps_.newest(); }
  std::size_t odometryHeldBack() const { return odometry_stamps_.heldBack(); }
  std::size_t scansHeldBack() const;

 private:
  Scans admit(const Scan& message, std::size_t laser, const std::string& kind, const std::string& problem);
  Samples admitByStamp(const OdometrySample& sample);
  Stamp newestScan() const;
  void warnOfHeldBack(const std::string& what, Stamp stamp);

  std::string odometry_source_;
  std::vector<std::string> scan_topics_;
  Health& health_;
  Warnings& warnings_;
  StampGuard<OdometrySample> odometry_stamps_;
  std::vector<StampGuard<Scan>> scan_stamps_;  // of each laser
};

}  // namespace sckf
