// What is wrong with messages by themselves, and by their stamps: they are refused, counted, and it is said why.
#pragma once

#include <nav_msgs/Odometry.h>

#include <string>

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

  /// odometry_source: a topic, or TF. health and warnings must live as long as the gate.
  InputGate(const NodeOptions& options, const std::string& odometry_source, const std::string& scan_topic,
            Health& health, Warnings& warnings);

  /// What may be used now that the message has come.
  Scans admit(const sensor_msgs::LaserScan::ConstPtr& message);
  Scans admit(const sensor_msgs::PointCloud2::ConstPtr& message);

  /// The same of odometry from a topic; tf relates its frame to base_frame. What its twist covariance is worth is
  /// looked at where it would be used.
  Samples admit(const nav_msgs::Odometry& message, bool uses_twist_covariance, TfInput& tf);

  /// The same of odometry from TF.
  Samples admit(const OdometrySample& sample);

  /// kind: for the count, reason: value and what is expected.
  void refuseScan(const std::string& kind, const std::string& reason);
  void refuseOdometry(const std::string& kind, const std::string& reason);

  /// Time went back, as odometry or scans have told: the others will follow.
  void restart();

  Stamp newestOdometry() const { return odometry_stamps_.newest(); }
  std::size_t odometryHeldBack() const { return odometry_stamps_.heldBack(); }
  std::size_t scansHeldBack() const { return scan_stamps_.heldBack(); }

 private:
  Scans admit(const Scan& message, const std::string& kind, const std::string& problem);
  Samples admitByStamp(const OdometrySample& sample);
  void warnOfHeldBack(const std::string& what, Stamp stamp);

  std::string odometry_source_;
  std::string scan_topic_;
  Health& health_;
  Warnings& warnings_;
  StampGuard<OdometrySample> odometry_stamps_;
  StampGuard<Scan> scan_stamps_;
};

}  // namespace sckf
