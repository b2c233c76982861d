// The velocity of base_link from wheel odometry.
#pragma once

#include <Eigen/Core>
#include <deque>

#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/matching/laser_scan.h"

namespace sckf {

/// (vx, vy, yaw rate) in base_link [m/s, m/s, rad/s].
struct Twist {
  /// The variance of a twist that is not known (no odometry over some time yet): larger than any robot is fast.
  static constexpr double kUnknownVariance = 1e6;

  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = kUnknownVariance * Eigen::Matrix3d::Identity();
};

/// The mean twist over the last increments that together last at least a given time. Drivers send odometry in bursts
/// with gaps of a millisecond and less, over which a difference quotient is nonsense.
class TwistWindow {
 public:
  /// duration: [s], > 0.
  explicit TwistWindow(double duration) : duration_(duration) {}

  /// From the next increment on.
  void setDuration(double duration) { duration_ = duration; }

  /// The motion up to the stamp, made in dt [s].
  void add(const OdometryIncrement& increment, double dt);
  Twist twist() const;

 private:
  struct Part {
    OdometryIncrement increment;
    double dt;
  };
  double duration_;
  double covered_ = 0.0;
  std::deque<Part> parts_;
};

}  // namespace sckf
