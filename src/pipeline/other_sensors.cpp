#include "sckf_odometry/pipeline/other_sensors.h"

namespace sckf {

StateOptions statesFor(const CalibrationOptions& calibration, const ImuOptions& imu) {
  StateOptions states;
  states.calibration_std << calibration.distance_std, calibration.rotation_std, calibration.rotation_per_meter_std,
      calibration.laser_ahead_std, calibration.floor_std, calibration.floor_std;
  states.calibration_way = calibration.way;
  if (imu.gyro) {
    states.gyro_bias_std = imu.gyro_bias_std;
    states.gyro_bias_drift = imu.gyro_bias_drift;
  }
  if (imu.orientation) states.heading_drift = imu.heading_drift;
  return states;
}

MotionMeasurement gyroMeasurement(double rotation, double yaw_of_increment, double dt, const ImuOptions& options) {
  MotionMeasurement z{Eigen::RowVector3d(0.0, 0.0, 1.0), Innovation::Vector(1), Displacement::MatrixDD(1, 1), dt};
  z.value << yaw_of_increment + wrapAngle(rotation - yaw_of_increment);
  z.noise << options.gyro_noise * options.gyro_noise * dt;
  return z;
}

MotionMeasurement standstillMeasurement(double dt, const StandstillOptions& options) {
  const Eigen::Matrix3d noise = options.std * options.std * dt * Eigen::Matrix3d::Identity();
  return {Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero(), noise, 0.0};
}

}  // namespace sckf
