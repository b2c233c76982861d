// The estimate in two frames: in odom, which nothing but motion moves, and in map, where absolute poses correct it.
#pragma once

#include <memory>
#include <string>
#include <utility>

#include "sckf_odometry/core/multi_clone_filter.h"

namespace sckf {

/// Absolute poses of the robot, told by amcl, a marker, motion capture.
struct PoseUpdateOptions {
  bool on = false;
  int max_rejected = 10;  ///< so many poses in a row that contradict the estimate make it begin anew at the last one
};

/// What became of an absolute pose.
enum class PoseOutcome {
  kEntered,      ///< the first one, or after too many that contradicted: the estimate in map begins there
  kUsed,         ///< it corrected the estimate in map
  kContradicts,  ///< it contradicts the estimate beyond the gate: not used
  kTooLate,      ///< its time is past, and forgotten: not used
  kNoOdometry,   ///< no odometry came for its stamp: not used
  kNoPose,       ///< its numbers are none, or its covariance is not positive definite: not used
};
std::string toString(PoseOutcome outcome);

/// Two filters that take the same motion, the same displacements and the same landmarks. What LandmarkStates tells is
/// of the one in odom, which stays as it would be without absolute poses: its estimate never jumps. The other one
/// begins as its copy, put into map by the first absolute pose, and takes those that follow.
class MapFilter : public LandmarkStates {
 public:
  explicit MapFilter(std::unique_ptr<MultiCloneFilter> odom) : odom_(std::move(odom)) {}

  SE2 pose() const override { return odom_->pose(); }
  Eigen::Matrix3d covariance() const override { return odom_->covariance(); }
  DisplacementPrediction predictedDisplacement() const override { return odom_->predictedDisplacement(); }
  DisplacementPrediction predictedDisplacementFrom(std::size_t clone) const override {
    return odom_->predictedDisplacementFrom(clone);
  }
  Innovation innovation(const Displacement& displacement) const override { return odom_->innovation(displacement); }
  OdometryIncrement refined(const OdometryIncrement& increment, double yaw) const override {
    return odom_->refined(increment, yaw);
  }
  WheelCalibration calibration() const override { return odom_->calibration(); }
  GyroBias gyroBias() const override { return odom_->gyroBias(); }
  std::size_t clones() const override { return odom_->clones(); }
  std::size_t landmarks() const override { return odom_->landmarks(); }
  SE2 landmark(std::size_t number) const override { return odom_->landmark(number); }
  Eigen::Matrix3d landmarkCovariance(std::size_t number) const override { return odom_->landmarkCovariance(number); }
  Innovation innovation(std::size_t landmark, const Sighting& sighting) const override {
    return odom_->innovation(landmark, sighting);
  }

  void propagate(const OdometryIncrement& increment) override;
  void age(double dt) override;
  void beginScan() override;
  void update(const Displacement& displacement, const Innovation& innovation) override;
  double updateHeading(double yaw, double variance, double nis_bound) override;
  void clone(const Eigen::VectorXd& range_variances) override;
  void forget(std::size_t clone) override;
  void loosen(const Eigen::Matrix3d& covariance) override;
  void addLandmark(const Sighting& sighting) override;
  void forgetLandmark(std::size_t number) override;
  void update(std::size_t landmark, const Sighting& sighting) override;

  /// Of base_link in map, now. Its covariance must be positive definite. nis_bound: what contradicts has a larger
  /// innovation, normalised and squared; nis, if not null, gets it.
  PoseOutcome update(const PoseMeasurement& map_from_base, double nis_bound, int max_rejected, double* nis = nullptr);

  /// map_from_base and its covariance; null before the first absolute pose.
  const FusionMethod* inMap() const { return map_.get(); }

 private:
  PoseOutcome enter(const PoseMeasurement& map_from_base);

  std::unique_ptr<MultiCloneFilter> odom_;
  std::unique_ptr<MultiCloneFilter> map_;
  int rejected_ = 0;  // absolute poses in a row
};

}  // namespace sckf
