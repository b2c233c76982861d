// A robot on a line (paper VII-C, figure 7).
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

namespace sckf {

struct OneDimensionOptions {
  double density = 5.0;    ///< ρ, features per metre of the line
  double field = 10.0;     ///< ℓ_max, the range ahead in which features are seen [m]
  double range_std = 0.2;  ///< σ of the distance to a feature [m]
  double way = 100.0;      ///< ℓ_total [m]
  int runs = 400;          ///< of the Monte Carlo simulation
  std::uint64_t seed = 1;
};

/// (45): the variance at the end, without C [m²].
double closedFormWithoutCorrelations(const OneDimensionOptions& options, double spacing);

/// (47), and (45) where no feature is seen three times: the variance at the end, with C [m²].
double closedForm(const OneDimensionOptions& options, double spacing);

/// What (47) leaves out: nothing comes before the first displacement that it could be correlated with, so that it
/// brings its whole variance, −2C more than the others [m²].
double firstDisplacementExcess(const OneDimensionOptions& options, double spacing);

struct OneDimensionPoint {
  double spacing = 0.0;            ///< Δℓ [m]
  double with_correlations = 0.0;  ///< variance at the end by the filter (33), mean over the runs [m²]
  double without = 0.0;            ///< the same without C
  double squared_error = 0.0;      ///< mean over the runs of the true squared error [m²]
};

/// The simulated filter. The way is a whole number of spacings: each is rounded so that it is. tick: after each
/// spacing.
std::vector<OneDimensionPoint> simulateOneDimension(const OneDimensionOptions& options,
                                                    const std::vector<double>& spacings,
                                                    const std::function<void()>& tick);

}  // namespace sckf
