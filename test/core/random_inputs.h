// Reproducible random inputs of the core.
#pragma once

#include <Eigen/Core>

#include "sckf_odometry/core/displacement.h"
#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/experiments/random_draws.h"

namespace sckf {

class RandomInputs : public RandomDraws {
 public:
  using RandomDraws::gaussian;
  using RandomDraws::RandomDraws;

  int integer(int low, int high);  // both inclusive
  double magnitude(double low, double high);

  Eigen::MatrixXd gaussian(Eigen::Index rows, Eigen::Index cols);
  /// n × n.
  Eigen::MatrixXd orthogonal(Eigen::Index n);
  SE2 pose(double extent);
  /// Positive definite, n × n, standard deviations about std_dev.
  Eigen::MatrixXd covariance(Eigen::Index n, double std_dev);
  OdometryIncrement increment(double std_dev);
  /// A displacement of d random directions near the predicted one, with Jacobians and noises of every size and sign.
  Displacement displacement(const SE2& predicted, int d, const Eigen::VectorXd& variance_reference,
                            const Eigen::VectorXd& variance_current, double matching_std);
  /// The diagonal of R of a scan with that many ranges [m²].
  Eigen::VectorXd rangeVariances(int ranges, double low_std, double high_std);
};

}  // namespace sckf
