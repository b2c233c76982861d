// The pose by scan matching alone (paper IV).
#pragma once

#include "sckf_odometry/core/displacement_covariance.h"
#include "sckf_odometry/core/fusion_method.h"

namespace sckf {

/// The pose at a scan is X̂_k ⊕ z, from the clone by the displacement, whatever the wheels say, with the covariance
/// (33).
///
/// Wheels fill the gaps only. Between scans they carry the pose on from the last one; where there is no displacement
/// they carry it to the next; and of a displacement that sees d < 3 directions the rest is theirs, with the covariance
/// of their model. Between two displacements that both see everything, nothing is left of them.
class DisplacementOnly : public FusionMethod {
 public:
  using Covariance = DisplacementCovariance<3>;
  using Correlations = Covariance::Correlations;

  DisplacementOnly(const SE2& odom_from_base, const Eigen::Matrix3d& covariance,
                   Correlations correlations = Correlations::kKept);

  SE2 pose() const override { return compose(clone_, displacement_); }
  Eigen::Matrix3d covariance() const override;

  void propagate(const OdometryIncrement& increment) override;
  DisplacementPrediction predictedDisplacement() const override;
  Innovation innovation(const Displacement& displacement) const override;
  void update(const Displacement& displacement, const Innovation& innovation) override;
  void clone(const Eigen::VectorXd& range_variances) override;

 private:
  /// As the covariance is to see it: without correlations, all of its noise is white.
  Covariance::Measurement measurement(const Displacement& displacement) const;

  SE2 clone_;         // odom_from_base at the reference scan
  SE2 displacement_;  // D, reference_from_base
  Covariance covariance_;
  Correlations correlations_;
};

}  // namespace sckf
