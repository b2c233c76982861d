#include "sckf_odometry/pipeline/chi_squared.h"

#include <boost/math/distributions/chi_squared.hpp>

namespace sckf {

double chiSquared(Eigen::Index degrees_of_freedom, double p) {
  return boost::math::quantile(boost::math::chi_squared(static_cast<double>(degrees_of_freedom)), p);
}

}  // namespace sckf
