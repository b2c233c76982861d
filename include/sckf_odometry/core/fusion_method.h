// The interface behind which the ways to fuse wheel odometry and displacements stand side by side.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "sckf_odometry/core/displacement.h"
#include "sckf_odometry/core/joint_covariance.h"
#include "sckf_odometry/core/se2.h"

namespace sckf {

/// Wheel odometry between two instants.
struct OdometryIncrement {
  SE2 before_from_after;                                 ///< motion of base_link, in base_link before the motion
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< Q of its error, in base_link before the motion
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

  virtual DisplacementPrediction predictedDisplacement() const = 0;  ///< from the newest clone

  /// Residual, its covariance and the gain that update() would use: for gating. The displacement must see at least
  /// one direction (d ≥ 1), and have J_reference with as many columns as the last clone() had ranges.
  virtual Innovation innovation(const Displacement& displacement) const = 0;
  virtual void update(const Displacement& displacement, const Innovation& innovation) = 0;

  /// The methods of the paper have one clone, which clone() replaces. Others have several, the newest number 0, and any
  /// of them can be the reference of a displacement.
  virtual std::size_t clones() const { return 1; }
  virtual DisplacementPrediction predictedDisplacementFrom(std::size_t /*clone*/) const {
    return predictedDisplacement();
  }
  virtual void forget(std::size_t /*clone*/) {}

  /// The present scan becomes the reference. range_variances (M): the diagonal of its R [m²].
  virtual void clone(const Eigen::VectorXd& range_variances) = 0;
};

/// The names that makeFusionMethod() knows, the default first.
const std::vector<std::string>& fusionMethodNames();

/// The method of that name, started at a pose with a covariance; null if there is no such name.
std::unique_ptr<FusionMethod> makeFusionMethod(const std::string& name, const SE2& odom_from_base,
                                               const Eigen::Matrix3d& covariance);

}  // namespace sckf
