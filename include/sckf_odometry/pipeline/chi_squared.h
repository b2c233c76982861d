// Bounds of what is still likely.
#pragma once

#include <Eigen/Core>
#include <boost/math/distributions/chi_squared.hpp>

namespace sckf {

/// The value that a χ² variable of so many degrees of freedom exceeds with probability 1 − p.
inline double chiSquared(Eigen::Index degrees_of_freedom, double p) {
  return boost::math::quantile(boost::math::chi_squared(static_cast<double>(degrees_of_freedom)), p);
}

}  // namespace sckf
