// Stochastic cloning with several clones: the present scan may be compared with any of the references that are kept.
// Sections III-F and V of the paper of stochastic_cloning_filter.h.
#pragma once

#include <optional>
#include <vector>

#include "sckf_odometry/core/error_state.h"
#include "sckf_odometry/core/landmark_states.h"

namespace sckf {

/// An extended Kalman filter of the present pose, of every clone and, if asked for, of states that are not cloned:
/// systematic errors of the wheels, the bias of a gyro, the heading of a compass, landmarks. The range noise of the
/// scans is considered. A displacement from the newest clone corrects all but the clones, as in Algorithm 1; one from
/// an older clone corrects the clones too. clone() adds a clone, the newest, number 0; forget() removes one.
///
/// Beyond the paper, its error state ξ = (ρ, θ) is a displacement of the world: X = exp(ξ) ⊕ X̂, so that
///   X̃ = T(X̂) ξ,  T = [I 𝒥p̂; 0 1].
/// The motion of the robot leaves ξ as it is, and a displacement between two poses sees nothing but the difference of
/// their ξ, wherever they are estimated to be: nothing that is common to all poses is ever taken for known. The
/// residual of a displacement is the ξ that leads from its prediction to it, so that corrections may be large.
class MultiCloneFilter : public LandmarkStates {
 public:
  MultiCloneFilter(const SE2& odom_from_base, const Eigen::Matrix3d& covariance, const StateOptions& states = {});

  SE2 pose() const override { return inWorld(pose_); }
  Eigen::Matrix3d covariance() const override;
  SE2 clonedPose(std::size_t clone) const { return inWorld(clones_[clone].pose); }
  WheelCalibration calibration() const override;
  GyroBias gyroBias() const override { return {gyro_bias_, varianceOf(gyro_bias_error_)}; }

  void propagate(const OdometryIncrement& increment) override;
  OdometryIncrement refined(const OdometryIncrement& increment, double yaw) const override;

  void beginScan() override;
  std::size_t clones() const override { return clones_.size(); }
  DisplacementPrediction predictedDisplacement() const override { return predictedDisplacementFrom(0); }
  DisplacementPrediction predictedDisplacementFrom(std::size_t clone) const override;
  Innovation innovation(const Displacement& displacement) const override;
  void update(const Displacement& displacement, const Innovation& innovation) override;
  void clone(const Eigen::VectorXd& range_variances) override;
  void forget(std::size_t clone) override;
  void loosen(const Eigen::Matrix3d& covariance) override;

  /// Measurements that are no displacements (V-A): all states are corrected, unless the innovation, normalised and
  /// squared, exceeds a bound. Returns it.
  double update(const PoseMeasurement& measurement, double nis_bound);
  double updateHeading(double yaw, double variance, double nis_bound) override;
  void age(double dt) override;

  /// The error of a landmark is a ξ as that of a clone: what is common to it and the robot is never taken for known.
  std::size_t landmarks() const override { return landmarks_.size(); }
  SE2 landmark(std::size_t number) const override { return inWorld(landmarks_[number].pose); }
  Eigen::Matrix3d landmarkCovariance(std::size_t number) const override;
  void addLandmark(const Sighting& sighting) override;
  void forgetLandmark(std::size_t number) override;
  Innovation innovation(std::size_t landmark, const Sighting& sighting) const override;
  void update(std::size_t landmark, const Sighting& sighting) override;

  /// The same robot in another world, of which only the pose there is known, to a covariance.
  void enterWorld(const PoseMeasurement& world_from_base);

 private:
  using Part = ErrorState::Part;
  using Measurement = ErrorState::Measurement;

  struct Clone {
    SE2 pose;
    Part error;
    ErrorState::Ranges ranges;
  };

  struct Landmark {
    SE2 pose;
    Part error;
  };

  SE2 inWorld(const SE2& pose) const;
  double varianceOf(const std::optional<Part>& part) const;

  // The motion (multi_clone_filter_motion.cpp).
  void beginCalibration(const std::optional<WheelCalibration>& known);
  Eigen::MatrixXd calibrationCovarianceAtFirst() const;
  OdometryIncrement calibrated(const OdometryIncrement& increment, const WheelCalibration::Jacobian& B) const;
  void turnCalibration(double yaw, Part world_error);
  void measureMotion(const OdometryIncrement& increment, const WheelCalibration::Jacobian& B, const Eigen::Matrix3d& W);
  void forgetCalibration();

  // What corrects it (multi_clone_filter.cpp).
  Measurement measurement(const Displacement& displacement, const Innovation& innovation) const;
  Measurement measurement(std::size_t landmark, const Sighting& sighting) const;
  double update(const Measurement& measurement, double nis_bound);

  std::vector<Part> statesNotCloned() const;
  std::vector<Part> allStates() const;
  /// anchor: a pose that stays where it is, whatever is learned of the wheels. Returns by what, part for part.
  std::vector<Eigen::VectorXd> correct(const Measurement& measurement, const ErrorState::Correlation& with_r,
                                       const std::vector<Part>& parts, const std::optional<Part>& anchor);
  std::vector<ErrorState::Gain> gains(const Measurement& measurement, const ErrorState::Correlation& with_r,
                                      const std::vector<Part>& parts, const std::optional<Part>& anchor);
  Eigen::MatrixXd commonByRanges(const Part& part, const Measurement& measurement) const;
  Eigen::MatrixXd learnedOf(const Part& anchor, const Measurement& measurement,
                            const ErrorState::Correlation& with_r) const;
  SE2* placeOf(const Part& part);

  StateOptions options_;
  ErrorState errors_;

  Eigen::Vector2d origin_;  // in the world, of the poses below: where the estimate began
  SE2 pose_;                // of base_link
  Part pose_error_;
  std::vector<Clone> clones_;                  // the newest first
  std::optional<ErrorState::Ranges> present_;  // of the present scan, once it has been used

  WheelCalibration::Vector calibration_ = WheelCalibration::Vector::Zero();
  WheelCalibration::Columns calibrated_;  // a column of the identity for each error that is estimated
  std::optional<Part> calibration_error_;
  double way_to_forget_ = 0.0;  // [m] since some of it was forgotten
  double gyro_bias_ = 0.0;      // [rad/s]
  std::optional<Part> gyro_bias_error_;
  double compass_from_world_ = 0.0;  // [rad]
  std::optional<Part> compass_error_;
  std::vector<Landmark> landmarks_;
  bool places_told_ = false;  // by something that is no displacement: a landmark, a pose or a heading in the world
};

}  // namespace sckf
