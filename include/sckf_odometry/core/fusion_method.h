// The interface behind which the ways to fuse wheel odometry and displacements stand side by side.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sckf_odometry/core/displacement.h"
#include "sckf_odometry/core/joint_covariance.h"
#include "sckf_odometry/core/se2.h"
#include "sckf_odometry/core/wheel_calibration.h"

namespace sckf {

/// What another sensor says of the motion that an OdometryIncrement is about: value = S u + bias_time b + n, where u is
/// the true (x, y, yaw) and b the bias of the gyro.
struct MotionMeasurement {
  Displacement::MatrixD3 seen;   ///< S, d × 3
  Innovation::Vector value;      ///< d, of [m, rad]
  Displacement::MatrixDD noise;  ///< covariance of n, d × d
  double bias_time = 0.0;        ///< [s] over which a gyro turned its rate into a yaw, d = 1; 0: no gyro
};

/// Wheel odometry between two instants.
struct OdometryIncrement {
  SE2 before_from_after;                                 ///< motion of base_link, in base_link before the motion
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< Q of its error, in base_link before the motion
  bool by_wheels = true;  ///< false: free of their systematic errors: guessed, or jitter while the robot stands
  std::vector<MotionMeasurement> measured = {};  ///< by others; methods without such states leave it aside
};

/// Where the robot is in the world of an estimator, told by something else than displacements.
struct PoseMeasurement {
  SE2 pose;                    ///< world_from_base
  Eigen::Matrix3d covariance;  ///< of its additive error in x, y, yaw
};

/// What a gyro tells of a robot that does not turn.
struct GyroBias {
  double value = 0.0;     ///< [rad/s]
  double variance = 0.0;  ///< of what it errs by; zero: it is not estimated
};

/// States beside the pose that are not cloned (III-F). Where a standard deviation is zero there is no such state.
struct StateOptions {
  /// Of the errors of WheelCalibration: how large they can be. They are taken for stationary processes, which forget
  /// what they were within calibration_way [m]: an error of the wheels that passes leaves nothing behind.
  WheelCalibration::Vector calibration_std = WheelCalibration::Vector::Zero();
  double calibration_way = 100.0;

  double gyro_bias_std = 0.0;    ///< [rad/s] of b at the start …
  double gyro_bias_drift = 0.0;  ///< [rad/s/√s] … and by how much it wanders

  double heading_drift = 0.0;  ///< [rad/√s] by how much a compass and the yaw in the world come apart

  /// What is known of them at the start, where that is more than how large they can be.
  std::optional<WheelCalibration> known_calibration = {};
  std::optional<GyroBias> known_gyro_bias = {};
};

/// What a method expects the next displacement to be, before the scans are looked at.
struct DisplacementPrediction {
  SE2 reference_from_current;                            ///< ẑ (16)
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of its error, range noise left aside
};

/// An estimator of odom_from_base. It takes, in the order of time,
///   propagate(increment) … predictedDisplacement() → [innovation() → update()] → [clone()],
/// where a displacement always relates the pose at the last clone() to the present pose.
class FusionMethod {
 public:
  virtual ~FusionMethod() = default;

  virtual SE2 pose() const = 0;                    ///< odom_from_base
  virtual Eigen::Matrix3d covariance() const = 0;  ///< of the error of pose()

  virtual void propagate(const OdometryIncrement& increment) = 0;

  /// The wheels slipped: what they said since the last update may be wrong by this covariance (in base_link) more.
  virtual void distrustWheels(const Eigen::Matrix3d& covariance) { propagate({SE2(), covariance}); }

  /// Another scan is at hand, perhaps of the same instant: the range noise of the one before is done with, unless that
  /// has become a reference. propagate() says the same.
  virtual void beginScan() {}

  virtual DisplacementPrediction predictedDisplacement() const = 0;  ///< from the newest clone

  /// Residual, its covariance and the gain that update() would use: for gating. The displacement must see at least
  /// one direction (d ≥ 1), and have J_reference with as many columns as the last clone() had ranges.
  virtual Innovation innovation(const Displacement& displacement) const = 0;
  /// innovation: that of the displacement, by the state as it is now.
  virtual void update(const Displacement& displacement, const Innovation& innovation) = 0;

  /// What the increment is with all that is known of the wheels and all that is measured of the motion. yaw: of
  /// base_link in the world before it [rad].
  virtual OdometryIncrement refined(const OdometryIncrement& increment, double /*yaw*/) const { return increment; }
  virtual WheelCalibration calibration() const { return {}; }
  virtual GyroBias gyroBias() const { return {}; }

  /// Time passes: for what drifts with it. [s]
  virtual void age(double /*dt*/) {}

  /// yaw: of base_link in the frame of a compass or an IMU, whose own yaw in the world is estimated. variance [rad²].
  /// Returns the innovation, normalised and squared; beyond the bound it corrects nothing.
  virtual double updateHeading(double /*yaw*/, double /*variance*/, double /*nis_bound*/) { return 0.0; }

  /// The methods of the paper have one clone, which clone() replaces. Others have several, the newest number 0, and any
  /// of them can be the reference of a displacement.
  virtual std::size_t clones() const { return 1; }
  virtual DisplacementPrediction predictedDisplacementFrom(std::size_t /*clone*/) const {
    return predictedDisplacement();
  }
  virtual void forget(std::size_t /*clone*/) {}

  /// The pose errs by this covariance (in base_link) more than measurements tell, before its scan becomes a reference.
  /// Methods that know of no such error leave it aside.
  virtual void loosen(const Eigen::Matrix3d& /*covariance*/) {}

  /// The present scan becomes the reference. range_variances (M): the diagonal of its R [m²].
  virtual void clone(const Eigen::VectorXd& range_variances) = 0;
};

/// The names that makeFusionMethod() knows, the default first.
const std::vector<std::string>& fusionMethodNames();

/// The method of that name, started at a pose with a covariance; null if there is no such name. Only sckf_multi has
/// other states.
std::unique_ptr<FusionMethod> makeFusionMethod(const std::string& name, const SE2& odom_from_base,
                                               const Eigen::Matrix3d& covariance, const StateOptions& states = {});

}  // namespace sckf
