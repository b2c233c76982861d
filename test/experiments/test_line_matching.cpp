#include <gtest/gtest.h>

#include <boost/math/distributions/chi_squared.hpp>

#include "sckf_odometry/experiments/line_matching.h"

namespace sckf {
namespace {

std::vector<LineMatchingSample> simulate(const std::string& method, double laps = 1.0, double spacing = 0.25) {
  LineMatchingOptions options;
  options.runs = 60;
  options.laps = laps;
  options.spacing = spacing;
  return simulateLineMatching(options, method, [] {});
}

TEST(LineMatching, CovarianceOfTheScKfCanBeBelieved) {
  constexpr int kRuns = 60;
  const boost::math::chi_squared sum(3 * kRuns);
  const auto samples = simulate("sckf");
  for (std::size_t i = 9; i < samples.size(); i += 10) {
    EXPECT_GT(samples[i].nees, boost::math::quantile(sum, 0.0005) / kRuns) << samples[i].way << " m";
    EXPECT_LT(samples[i].nees, boost::math::quantile(sum, 0.9995) / kRuns) << samples[i].way << " m";
  }
}

TEST(LineMatching, CovarianceOfTheScKfNcIsFarTooLarge) {
  const auto samples = simulate("sckf_nc");
  for (std::size_t i = 29; i < samples.size(); i += 10) EXPECT_LT(samples[i].nees, 2.0) << samples[i].way << " m";
  EXPECT_LT(samples.back().normalized_square.y(), 0.5) << "across the wall";
  EXPECT_LT(samples.back().normalized_square.z(), 0.1) << "yaw";
}

TEST(LineMatching, ErrorsOfTheScKfAreSmaller) {
  const Eigen::Vector3d with = rootMeanSquare(simulate("sckf"));
  const Eigen::Vector3d without = rootMeanSquare(simulate("sckf_nc"));
  EXPECT_NEAR(with.x() / without.x(), 1.0, 0.02) << "along the wall only the wheels see";
  EXPECT_LT(with.y(), 0.8 * without.y()) << "across it";
  EXPECT_LT(with.z(), without.z()) << "yaw";
}

TEST(LineMatching, MeetsTheSameNoiseWithEveryMethod) {
  const auto a = simulate("dead_reckoning", 0.1);
  const auto b = simulate("dead_reckoning", 0.1);
  ASSERT_EQ(a.size(), b.size());
  EXPECT_EQ(a.back().error_of_first_run, b.back().error_of_first_run);
}

}  // namespace
}  // namespace sckf
