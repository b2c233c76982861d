// Bounds of what is still likely.
#pragma once

#include <Eigen/Core>

namespace sckf {

/// The value that a χ² variable of so many degrees of freedom exceeds with probability 1 − p.
double chiSquared(Eigen::Index degrees_of_freedom, double p);

}  // namespace sckf
