// Places far from what the wheels tell: where the search finds them, and when a match is looked for there.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "matching/simulated_world.h"
#include "sckf_odometry/matching/scan_matcher.h"
#include "sckf_odometry/matching/wide_search.h"

namespace sckf::test {
namespace {

std::shared_ptr<const PreparedScan> scanFrom(const World& world, const SE2& pose, double noise = 0.01) {
  std::mt19937_64 random(static_cast<std::uint64_t>(1e3 * (10.0 + pose.x + pose.yaw)));
  SimulatedLaser laser = frontLaser();
  laser.noise = noise;
  return prepareScan(simulateScan(world, pose, laser, &random), laser.base_from_laser, ScanOptions());
}

TEST(WideSearch, FindsThePlaceToAStep) {
  const auto reference = scanFrom(room(), SE2());
  for (const SE2& truth : {SE2(0.0, 0.0, 1.1), SE2(0.8, 0.1, -0.9), SE2(-0.7, -0.6, 0.5), SE2(0.9, 0.9, 0.0)}) {
    const SE2 found = widelySearched(*reference, *scanFrom(room(), truth), SE2(), WideSearchOptions());
    const Eigen::Vector3d e = error(found, truth);
    EXPECT_LT(e.head<2>().norm(), 0.16) << truth.vector().transpose() << ": " << e.transpose();
    EXPECT_LT(std::abs(e.z()), 0.05) << truth.vector().transpose() << ": " << e.transpose();
  }
}

TEST(WideSearch, WhereTheScansDoNotTellItStaysNearThePrediction) {
  const auto reference = scanFrom(corridor(), SE2());
  const SE2 found = widelySearched(*reference, *scanFrom(corridor(), SE2(0.5, 0.2, 0.6)), SE2(0.3, 0.0, 0.0),
                                   WideSearchOptions());
  EXPECT_NEAR(found.x, 0.3, 0.25) << "along the corridor";
  EXPECT_NEAR(found.y, 0.2, 0.1);
  EXPECT_NEAR(found.yaw, 0.6, 0.05);
}

TEST(WideSearch, LooksNoFartherThanItsBounds) {
  const auto reference = scanFrom(room(), SE2());
  const auto current = scanFrom(room(), SE2(0.9, 0.0, 0.9));
  WideSearchOptions options;
  options.translation = 0.4;
  options.yaw = 0.3;
  const SE2 found = widelySearched(*reference, *current, SE2(0.1, 0.0, 0.1), options);
  EXPECT_LE(std::abs(found.x - 0.1), 0.4 + 1e-9);
  EXPECT_LE(std::abs(found.y), 0.4 + 1e-9);
  EXPECT_LE(std::abs(found.yaw - 0.1), 0.3 + 1e-9);
  options.translation = 0.0;
  EXPECT_EQ(widelySearched(*reference, *current, SE2(0.1, 0.0, 0.1), options).x, 0.1);
}

/// What the wheels say that stood still while the robot turned.
DisplacementPrediction frozen() { return {SE2(), 1e-6 * Eigen::Matrix3d::Identity()}; }

TEST(WideSearch, FindsATurnThatTheWheelsDidNotTell) {
  const SE2 truth(0.6, 0.2, 1.0);
  const auto reference = scanFrom(room(), SE2());
  const auto current = scanFrom(room(), truth);
  const Match match = ScanMatcher(MatcherOptions()).match(*reference, *current, frozen());
  ASSERT_TRUE(match.displacement) << toString(match.failure);
  const Eigen::Vector3d e = error(match.displacement->reference_from_current, truth);
  EXPECT_LT(e.cwiseAbs().maxCoeff(), 0.01) << e.transpose();
  MatcherOptions without;
  without.wide_search.yaw = 0.0;
  const Match lost = ScanMatcher(without).match(*reference, *current, frozen());
  EXPECT_TRUE(!lost.displacement || error(lost.displacement->reference_from_current, truth).norm() > 0.3)
      << "found without it";
}

/// A few points that lie well on each other, near enough to the prediction, are not match enough to be left alone.
TEST(WideSearch, BeginsWhereTooFewPointsHaveAPartner) {
  const SE2 truth(0.9, -0.5, -0.8);
  const DisplacementPrediction vague{SE2(), 0.3 * 0.3 * Eigen::Matrix3d::Identity()};
  const auto offWith = [&](double below_overlap) {
    MatcherOptions options;
    options.wide_search_below_overlap = below_overlap;
    const Match match = ScanMatcher(options).match(*scanFrom(room(), SE2()), *scanFrom(room(), truth), vague);
    EXPECT_TRUE(match.displacement) << toString(match.failure);
    return match.displacement ? error(match.displacement->reference_from_current, truth).norm() : 1e9;
  };
  EXPECT_LT(offWith(0.5), 0.02);
  EXPECT_GT(offWith(0.0), 0.3);
}

}  // namespace
}  // namespace sckf::test
