// Messages of an IMU: turned into base_link, refused, counted, and it is said why.
#pragma once

#include <sensor_msgs/Imu.h>

#include <string>
#include <vector>

#include "sckf_odometry/pipeline/other_sensors.h"
#include "sckf_odometry/ros/health.h"
#include "sckf_odometry/ros/stamp_guard.h"
#include "sckf_odometry/ros/tf_input.h"
#include "sckf_odometry/ros/warnings.h"

namespace sckf {

class ImuInput {
 public:
  /// time_jump: [s] as of StampGuard. health and warnings must live as long as this.
  ImuInput(const ImuOptions& options, const std::string& topic, double time_jump, Health& health, Warnings& warnings);

  /// What may be used now that the message has come; tf relates its frame to base_frame. newest_odometry: stamp, zero
  /// if there is none.
  std::vector<ImuSample> admit(const sensor_msgs::Imu& message, Stamp newest_odometry, TfInput& tf);

  /// What the pipeline made of a sample. newest_odometry: as above.
  void ended(ImuBuffer::Insertion insertion, Stamp stamp, Stamp newest_odometry);
  /// It was not looked at, for a reason in words.
  void ended(const std::string& how) { health_.imu.ended(how); }

  const std::string& topic() const { return topic_; }

  /// Why the mount is not known, empty if it is or nothing has come.
  const std::string& mountProblem() const { return mount_problem_; }
  std::size_t heldBack() const { return stamps_.heldBack(); }

  /// Another time has begun.
  void restart() { stamps_.restart(); }

 private:
  std::vector<ImuSample> refuse(const std::string& kind, const std::string& reason);

  ImuOptions options_;
  std::string topic_;
  Health& health_;
  Warnings& warnings_;
  StampGuard<ImuSample> stamps_;
  std::string mount_problem_;
};

}  // namespace sckf
