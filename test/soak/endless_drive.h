// A robot that drives about in a room for as long as one likes, as its drivers tell it. Nothing of the past is kept.
#pragma once

#include <nav_msgs/Odometry.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_msgs/TFMessage.h>

#include <boost/make_shared.hpp>
#include <cmath>
#include <random>

#include "pipeline/simulated_drive.h"
#include "sckf_odometry/ros/conversions.h"

namespace sckf::test {

class EndlessDrive {
 public:
  static constexpr double kOdometryPeriod = 1.0 / 40.0;  // [s]
  static constexpr double kScanPeriod = 1.0 / 15.0;      // [s]

  explicit EndlessDrive(int beams) {
    laser_.beams = beams;
    laser_.angle_increment = 2.0 * M_PI / beams;
    laser_.noise = 0.01;
  }

  /// Time of the k-th message of each: scans fall between two of odometry.
  static Stamp odometryStamp(std::size_t k) { return stampAt(static_cast<double>(k) * kOdometryPeriod); }
  static Stamp scanStamp(std::size_t k) { return stampAt(static_cast<double>(k) * kScanPeriod + 0.01); }

  /// Pose of base_link in the frame of its start.
  static SE2 truth(Stamp stamp) { return between(roundDrive(0.0), roundDrive(secondsOf(stamp))); }

  tf2_msgs::TFMessagePtr mount() const {
    auto message = boost::make_shared<tf2_msgs::TFMessage>();
    message->transforms.push_back(toTransform(SE2(), stampAt(0.0), "base_link", "laser"));
    return message;
  }

  /// The next one: scale and heading are wrong by a few percent, and there is noise.
  nav_msgs::OdometryPtr nextOdometry() {
    const Stamp stamp = odometryStamp(odometry_++);
    const SE2 now = roundDrive(secondsOf(stamp));
    const SE2 motion = odometry_ == 1 ? SE2() : between(path_, now);
    const double way = motion.translation().norm();
    path_ = now;
    wheels_ = compose(
        wheels_, SE2(1.03 * motion.x, motion.y, motion.yaw + 0.02 * way + 0.02 * std::sqrt(way) * normal_(random_)));
    Estimate estimate;
    estimate.stamp = stamp;
    estimate.odom_from_base = wheels_;
    return boost::make_shared<nav_msgs::Odometry>(toOdometryMessage(estimate, "odom", "base_link"));
  }

  /// The k-th scan, as if base_link were displaced by so much.
  sensor_msgs::LaserScanPtr scan(std::size_t k, const SE2& displaced = {}) {
    const Stamp stamp = scanStamp(k);
    const LaserScan scan = simulateScan(world_, compose(roundDrive(secondsOf(stamp)), displaced), laser_, &random_);
    auto message = boost::make_shared<sensor_msgs::LaserScan>();
    message->header.stamp = toTime(stamp);
    message->header.frame_id = "laser";
    message->angle_min = static_cast<float>(scan.angle_min);
    message->angle_increment = static_cast<float>(scan.angle_increment);
    message->angle_max = message->angle_min + static_cast<float>(laser_.beams - 1) * message->angle_increment;
    message->range_min = static_cast<float>(scan.range_min);
    message->range_max = static_cast<float>(scan.range_max);
    message->ranges = scan.ranges;
    return message;
  }

 private:
  static constexpr double kStart = 1000.0;  // [s]
  static Stamp stampAt(double t) {
    return std::chrono::duration_cast<Stamp>(std::chrono::duration<double>(kStart + t));
  }
  static double secondsOf(Stamp stamp) { return std::chrono::duration<double>(stamp).count() - kStart; }

  World world_ = room();
  SimulatedLaser laser_;
  std::mt19937_64 random_{1};
  std::normal_distribution<double> normal_{0.0, 1.0};
  std::size_t odometry_ = 0;
  SE2 path_;
  SE2 wheels_;
};

}  // namespace sckf::test
