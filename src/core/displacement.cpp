#include "sckf_odometry/core/displacement.h"

#include <Eigen/LU>

#include "sckf_odometry/core/covariance.h"

namespace sckf {

Displacement::Matrix3D Displacement::fromObservable() const {
  const MatrixDD square = observable * observable.transpose();
  return observable.transpose() * square.inverse();
}

Displacement::MatrixDD Displacement::covariance() const {
  return carriedOver(J_reference, variance_reference) + carriedOver(J_current, variance_current) + matching_noise;
}

}  // namespace sckf
