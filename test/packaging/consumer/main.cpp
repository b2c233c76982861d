// Another package that uses the core alone: half a metre by the wheels.
#include <sckf_odometry/core/stochastic_cloning_filter.h>

#include <iostream>

int main() {
  sckf::StochasticCloningFilter filter(sckf::SE2(), Eigen::Matrix3d::Zero());
  filter.propagate({sckf::SE2(0.5, 0.0, 0.0), 0.01 * Eigen::Matrix3d::Identity()});
  std::cout << filter.pose().x << '\n';
}
