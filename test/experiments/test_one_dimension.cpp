#include <gtest/gtest.h>

#include <boost/math/distributions/chi_squared.hpp>

#include "sckf_odometry/experiments/one_dimension.h"

namespace sckf {
namespace {

std::vector<OneDimensionPoint> simulate(const OneDimensionOptions& options, const std::vector<double>& spacings) {
  return simulateOneDimension(options, spacings, [] {});
}

//  ρ = 5/m, 10 m ahead, σ = 0.2 m, 100 m. Every metre: 45 shared features and 100 displacements of 2 σ²/45 each, which
//  is 0.1778; with C 2 σ² · 100 / (5 · 81) = 0.01975. At 6 m no feature is seen three times: both are the same.
TEST(ClosedForm, IsTheOneComputedByHand) {
  const OneDimensionOptions options;
  EXPECT_NEAR(closedFormWithoutCorrelations(options, 1.0), 100.0 * 0.08 / 45.0, 1e-12);
  EXPECT_NEAR(closedForm(options, 1.0), 8.0 / 405.0, 1e-12);
  EXPECT_NEAR(firstDisplacementExcess(options, 1.0), 2.0 * 0.04 * 40.0 / (45.0 * 45.0), 1e-12);
  EXPECT_DOUBLE_EQ(closedForm(options, 6.0), closedFormWithoutCorrelations(options, 6.0));
  EXPECT_DOUBLE_EQ(firstDisplacementExcess(options, 6.0), 0.0);
}

TEST(OneDimension, FilterFollowsTheCurves) {
  OneDimensionOptions options;
  options.runs = 2;
  for (const OneDimensionPoint& point : simulate(options, {0.2, 1.0, 2.0, 4.0, 5.0})) {
    SCOPED_TRACE(point.spacing);  // whole numbers of features: the closed form is exact
    const double with = closedForm(options, point.spacing) + firstDisplacementExcess(options, point.spacing);
    EXPECT_NEAR(point.with_correlations, with, 1e-9 * with);
    const double without = closedFormWithoutCorrelations(options, point.spacing);
    EXPECT_NEAR(point.without, without, 1e-9 * without);
  }
}

TEST(OneDimension, ErrorsAreWhatTheFilterWithCorrelationsSays) {
  OneDimensionOptions options;
  options.runs = 200;
  const boost::math::chi_squared sum(options.runs);
  for (const OneDimensionPoint& point : simulate(options, {0.5, 2.0, 4.0, 7.0})) {
    const double normalised = options.runs * point.squared_error / point.with_correlations;
    EXPECT_GT(normalised, boost::math::quantile(sum, 0.001)) << point.spacing;
    EXPECT_LT(normalised, boost::math::quantile(sum, 0.999)) << point.spacing;
  }
}

TEST(OneDimension, IsMonotonicWithAndHasAValleyWithout) {
  OneDimensionOptions options;
  options.runs = 1;
  const auto points = simulate(options, {0.1, 0.5, 1.0, 2.0, 4.0, 5.0, 7.0, 8.3});
  for (std::size_t i = 1; i < points.size(); ++i) {
    EXPECT_GT(points[i].with_correlations, points[i - 1].with_correlations) << points[i].spacing;
    EXPECT_EQ(points[i].without < points[i - 1].without, points[i].spacing < 5.1) << points[i].spacing;
  }
}

}  // namespace
}  // namespace sckf
