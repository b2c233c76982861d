// How the filter with several clones follows the motion: by wheels, whose systematic errors it estimates, and by what
// others tell of it.
#include <Eigen/Cholesky>
#include <cmath>
#include <utility>

#include "sckf_odometry/core/covariance.h"
#include "sckf_odometry/core/multi_clone_filter.h"
#include "sckf_odometry/core/world_error.h"

namespace sckf {

namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using world_error::inverseOfAdditive;

/// A gyro or a compass knows what the wheels cannot: where they contradict it they have slipped, by about r.
void allowForSlip(const MotionMeasurement& z, const Innovation::Vector& r, const MatrixXd& S, Matrix3d& Q) {
  constexpr double kContradiction = 10.83;  // χ² with one degree of freedom, once in a thousand times
  if (r.size() == 1 && r(0) * r(0) > kContradiction * S(0, 0)) Q += z.seen.transpose() * r * r.transpose() * z.seen;
}

/// By the errors of the calibration; zero where the wheels do not tell the increment.
WheelCalibration::Jacobian byCalibration(const OdometryIncrement& increment, double yaw) {
  if (!increment.by_wheels) return WheelCalibration::Jacobian::Zero();
  return WheelCalibration::jacobian(increment.before_from_after, yaw);
}

}  // namespace

Eigen::MatrixXd MultiCloneFilter::calibrationCovarianceAtFirst() const {
  return (calibrated_.transpose() * options_.calibration_std).cwiseAbs2().asDiagonal();
}

void MultiCloneFilter::beginCalibration(const std::optional<WheelCalibration>& known) {
  if (!known) {
    calibration_error_ = errors_.add(calibrationCovarianceAtFirst());
    return;
  }
  calibration_ = calibrated_ * calibrated_.transpose() * known->error;
  calibration_error_ = errors_.add(calibrated_.transpose() * known->covariance * calibrated_);
}

OdometryIncrement MultiCloneFilter::calibrated(const OdometryIncrement& increment,
                                               const WheelCalibration::Jacobian& B) const {
  OdometryIncrement motion = increment;
  if (increment.by_wheels) motion.before_from_after = corrected(increment.before_from_after, B * calibration_);
  return motion;
}

/// Into a world that is turned by yaw, and by what that errs by, too.
void MultiCloneFilter::turnCalibration(double yaw, Part world_error) {
  if (!calibration_error_) return;
  const Eigen::MatrixXd R = calibrated_.transpose() * WheelCalibration::turn(yaw) * calibrated_;
  calibration_ = calibrated_ * R * calibrated_.transpose() * calibration_;
  errors_.move(*calibration_error_, R - MatrixXd::Identity(R.rows(), R.cols()), *calibration_error_);
  Eigen::Matrix<double, WheelCalibration::kErrors, 3> by_world =
      Eigen::Matrix<double, WheelCalibration::kErrors, 3>::Zero();
  by_world.bottomRightCorner<2, 1>() = quarterTurn(calibration_.tail<2>());
  errors_.move(*calibration_error_, calibrated_.transpose() * by_world, world_error);
}

void MultiCloneFilter::propagate(const OdometryIncrement& increment) {
  const WheelCalibration::Jacobian B = byCalibration(increment, pose_.yaw);
  const OdometryIncrement motion = calibrated(increment, B);
  Matrix3d G;
  pose_ = compose(pose_, motion.before_from_after, nullptr, &G);  // (8)
  const Matrix3d W = inverseOfAdditive(pose_) * G;
  const bool calibrates = calibration_error_ && increment.by_wheels;
  if (calibrates) errors_.move(pose_error_, W * B * calibrated_, *calibration_error_);
  if (increment.measured.empty()) {
    errors_.disturb(pose_error_, W * increment.covariance * W.transpose());  // (9)-(14)
  } else {
    measureMotion(increment, B, W);
  }
  if (calibrates) {
    constexpr double kLongest = 0.05;  // of the way after which the calibration may be another one, without a reference
    way_to_forget_ += increment.before_from_after.translation().norm();
    if (way_to_forget_ > kLongest * options_.calibration_way) forgetCalibration();
  }
  beginScan();
}

/// The wheels' noise is a part of the state while others tell of the motion.
void MultiCloneFilter::measureMotion(const OdometryIncrement& increment, const WheelCalibration::Jacobian& B,
                                     const Matrix3d& W) {
  const Vector3d u = increment.before_from_after.vector();
  const auto expected = [&](const Vector3d& noise) -> Vector3d { return u + B * calibration_ + noise; };
  const auto measurement = [&](const MotionMeasurement& z, const Vector3d& noise, const std::optional<Part>& part) {
    Measurement m;
    m.residual = z.value - z.seen * expected(noise);
    if (z.bias_time > 0.0) m.residual(0) -= z.bias_time * gyro_bias_;
    if (part) m.terms.push_back({*part, z.seen});
    if (calibration_error_) m.terms.push_back({*calibration_error_, z.seen * B * calibrated_});
    if (gyro_bias_error_ && z.bias_time > 0.0) {
      m.terms.push_back({*gyro_bias_error_, MatrixXd::Constant(1, 1, z.bias_time)});
    }
    m.noise = z.noise;
    return m;
  };

  Matrix3d Q = increment.covariance;
  for (const MotionMeasurement& z : increment.measured) {
    const Measurement m = measurement(z, Vector3d::Zero(), std::nullopt);
    allowForSlip(z, m.residual, errors_.correlate(m).innovation + z.seen * Q * z.seen.transpose(), Q);
  }
  const Part noise_error = errors_.add(Q);
  errors_.move(pose_error_, W, noise_error);
  Vector3d noise = Vector3d::Zero();
  std::vector<Part> parts = statesNotCloned();
  parts.push_back(noise_error);
  for (const MotionMeasurement& z : increment.measured) {
    const Measurement m = measurement(z, noise, noise_error);
    noise += correct(m, errors_.correlate(m), parts, clones_.front().error).back();
  }
  errors_.remove(noise_error);
}

OdometryIncrement MultiCloneFilter::refined(const OdometryIncrement& increment, double yaw) const {
  const WheelCalibration::Jacobian B = byCalibration(increment, yaw);
  OdometryIncrement motion = calibrated(increment, B);
  Matrix3d& Q = motion.covariance;
  if (calibration_error_) {
    const Eigen::Matrix3Xd by_estimated = B * calibrated_;
    Q += symmetric(by_estimated * errors_.covariance(*calibration_error_) * by_estimated.transpose());
  }
  for (const MotionMeasurement& z : increment.measured) {
    Innovation::Vector r = z.value - z.seen * motion.before_from_after.vector();
    MatrixXd R = z.noise;
    if (z.bias_time > 0.0) {
      r(0) -= z.bias_time * gyro_bias_;
      R(0, 0) += z.bias_time * z.bias_time * gyroBias().variance;
    }
    allowForSlip(z, r, z.seen * Q * z.seen.transpose() + R, Q);
    const MatrixXd S = z.seen * Q * z.seen.transpose() + R;
    const MatrixXd K = S.llt().solve(z.seen * Q).transpose();
    motion.before_from_after = corrected(motion.before_from_after, K * r);
    Q = symmetric(Q - K * z.seen * Q);
  }
  motion.measured.clear();
  return motion;
}

/// At each reference: from there to the next scan the calibration is the same, so that what a displacement tells of it
/// can be told from what it tells of the way before, see gains().
void MultiCloneFilter::forgetCalibration() {
  if (!calibration_error_) return;
  const double kept = std::exp(-std::exchange(way_to_forget_, 0.0) / options_.calibration_way);
  calibration_ *= kept;
  const Eigen::Index n = calibrated_.cols();
  errors_.move(*calibration_error_, (kept - 1.0) * MatrixXd::Identity(n, n), *calibration_error_);
  errors_.disturb(*calibration_error_, (1.0 - kept * kept) * calibrationCovarianceAtFirst());
}

void MultiCloneFilter::age(double dt) {
  const auto drift = [&](const std::optional<Part>& part, double rate) {
    if (part) errors_.disturb(*part, MatrixXd::Constant(1, 1, rate * rate * dt));
  };
  drift(gyro_bias_error_, options_.gyro_bias_drift);
  drift(compass_error_, options_.heading_drift);
}

}  // namespace sckf
