#include "sckf_odometry/core/fusion_method.h"

#include "sckf_odometry/core/dead_reckoning.h"
#include "sckf_odometry/core/displacement_only.h"
#include "sckf_odometry/core/multi_clone_filter.h"
#include "sckf_odometry/core/pseudo_absolute.h"
#include "sckf_odometry/core/stochastic_cloning_filter.h"

namespace sckf {

const std::vector<std::string>& fusionMethodNames() {
  static const std::vector<std::string> names{"sckf_multi",          "sckf",           "sckf_nc",
                                              "pseudo_absolute",     "dead_reckoning", "displacement_only",
                                              "displacement_only_nc"};
  return names;
}

std::unique_ptr<FusionMethod> makeFusionMethod(const std::string& name, const SE2& odom_from_base,
                                               const Eigen::Matrix3d& covariance, const StateOptions& states) {
  using Filter = StochasticCloningFilter;
  if (name == "sckf") return std::make_unique<Filter>(odom_from_base, covariance, Filter::Correlations::kKept);
  if (name == "sckf_nc") return std::make_unique<Filter>(odom_from_base, covariance, Filter::Correlations::kIgnored);
  if (name == "sckf_multi") return std::make_unique<MultiCloneFilter>(odom_from_base, covariance, states);
  if (name == "pseudo_absolute") return std::make_unique<PseudoAbsolute>(odom_from_base, covariance);
  if (name == "dead_reckoning") return std::make_unique<DeadReckoning>(odom_from_base, covariance);
  if (name == "displacement_only") {
    return std::make_unique<DisplacementOnly>(odom_from_base, covariance, DisplacementOnly::Correlations::kKept);
  }
  if (name == "displacement_only_nc") {
    return std::make_unique<DisplacementOnly>(odom_from_base, covariance, DisplacementOnly::Correlations::kIgnored);
  }
  return nullptr;
}

}  // namespace sckf
