#include "sckf_odometry/core/displacement.h"

#include "sckf_odometry/core/covariance.h"

namespace sckf {

Displacement::MatrixDD Displacement::covariance() const {
  return carriedOver(J_reference, variance_reference) + carriedOver(J_current, variance_current) + matching_noise;
}

}  // namespace sckf
