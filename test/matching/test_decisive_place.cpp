// The place that decides most of a displacement: which it is, what it may be off by, and what is done when it moves.
#include <gtest/gtest.h>

#include "matching/simulated_world.h"
#include "sckf_odometry/matching/decisive_place.h"
#include "sckf_odometry/matching/scan_matcher.h"

namespace sckf::test {
namespace {

/// Flat on all sides, turned against the walls: nothing of it is hidden by a motion of some centimetres.
World withBoxAt(World world, const Eigen::Vector2d& place) {
  std::vector<Eigen::Vector2d> corners;
  for (const double angle : {0.6, 2.2, 3.7, 5.3})
    corners.push_back(place + 0.25 * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  return withPolygon(std::move(world), corners);
}

struct Scene {
  World before;  // at the reference scan
  World after;   // at the current one
  SE2 motion;
  SE2 wheels;  // what they tell
  double wheels_std = 0.03;
  double noise = 0.005;

  Match match(const MatcherOptions& options = {}, std::uint64_t seed = 1) const {
    std::mt19937_64 random(seed);
    SimulatedLaser laser;
    laser.range_max = 12.0;
    laser.noise = noise;
    const SE2 start(0.0, 0.1, 0.0);
    const auto reference = prepareScan(simulateScan(before, start, laser, &random), laser.base_from_laser, {});
    const auto current =
        prepareScan(simulateScan(after, compose(start, motion), laser, &random), laser.base_from_laser, {});
    if (!reference || !current) return {};
    const Eigen::Vector3d std(wheels_std, wheels_std, wheels_std);
    return ScanMatcher(options).match(*reference, *current, {wheels, std.cwiseAbs2().asDiagonal()});
  }
};

MatcherOptions withPlaceStd(double std) {
  MatcherOptions options;
  options.estimation.place_std = std;
  return options;
}

TEST(DecisivePlace, DecidesAlongACorridorAndLittleInARoom) {
  const SE2 motion(0.1, 0.0, 0.02);
  const Eigen::Vector2d place(2.0, 0.6);
  const World with_box = withBoxAt(corridor(), place);
  const Match alone = Scene{with_box, with_box, motion, motion}.match();
  ASSERT_TRUE(alone.displacement) << toString(alone.failure);
  ASSERT_EQ(alone.displacement->dimension(), 3);
  EXPECT_GT(alone.decisive.share(), 0.8);
  EXPECT_NEAR(std::abs(alone.decisive.influence(0, 0)), 1.0, 0.2) << alone.decisive.influence;
  ASSERT_FALSE(alone.decisive.points.empty());
  EXPECT_LT(alone.decisive.points.size(), 40U) << "points, of 360";
  EXPECT_TRUE(alone.decisive.contains(alone.decisive.points.back()));
  EXPECT_FALSE(alone.decisive.contains(alone.decisive.points.back() + 1));

  const Match among_others = Scene{room(), room(), motion, motion}.match();
  ASSERT_TRUE(among_others.displacement) << toString(among_others.failure);
  EXPECT_LT(among_others.decisive.share(), 0.4);
  EXPECT_FALSE(DecisivePlace().contains(0));
}

/// Between two legs the wall behind is seen.
TEST(DecisivePlace, IsWhatStandsTogether) {
  const SE2 motion(0.1, 0.0, 0.02);
  const World world = withSomebodyAt(corridor(), {2.5, 0.3});
  const auto shareOfPlacesOf = [&](double size) {
    MatcherOptions options;
    options.estimation.place_size = size;
    return Scene{world, world, motion, motion}.match(options).decisive.share();
  };
  EXPECT_GT(shareOfPlacesOf(0.6), 0.9) << "somebody";
  EXPECT_LT(shareOfPlacesOf(0.12), 0.75) << "a leg";
}

TEST(DecisivePlace, ItsInfluenceIsHowFarTheDisplacementGoesWithIt) {
  constexpr double kStep = 0.01;
  const SE2 motion(0.1, 0.0, 0.02);
  const Eigen::Vector2d place(2.0, 0.6);
  const World before = withBoxAt(corridor(), place);
  MatcherOptions options;
  options.both_ways = false;
  options.moved_place_min_share = 0.0;
  const Match match = Scene{before, before, motion, motion, 0.03, 0.0}.match(options);
  ASSERT_TRUE(match.displacement && match.displacement->dimension() == 3);
  const Scene ahead{before, withBoxAt(corridor(), place + Eigen::Vector2d(kStep, 0.0)), motion, motion, 0.03, 0.0};
  const Scene back{before, withBoxAt(corridor(), place - Eigen::Vector2d(kStep, 0.0)), motion, motion, 0.03, 0.0};
  const Match a = ahead.match(options);
  const Match b = back.match(options);
  ASSERT_TRUE(a.displacement && b.displacement);
  const Eigen::Vector3d slope =
      error(a.displacement->reference_from_current, b.displacement->reference_from_current) / (2.0 * kStep);
  EXPECT_LT((match.decisive.influence.col(0) - slope).norm(), 0.15)
      << "told " << match.decisive.influence.col(0).transpose() << ", seen " << slope.transpose();
}

TEST(DecisivePlace, WhatItMayBeOffByIsNoiseOfTheDisplacement) {
  const SE2 motion(0.1, 0.0, 0.02);
  const World world = withBoxAt(corridor(), {2.0, 0.6});
  const Scene scene{world, world, motion, motion};
  MatcherOptions with = withPlaceStd(0.05);
  MatcherOptions without = withPlaceStd(0.0);
  with.both_ways = without.both_ways = false;
  const Match a = scene.match(with);
  const Match b = scene.match(without);
  ASSERT_TRUE(a.displacement && b.displacement);
  const Eigen::MatrixXd moved = 0.05 * a.displacement->observable * a.decisive.influence;
  const Eigen::MatrixXd expected = b.displacement->covariance() + moved * moved.transpose();
  EXPECT_LT((a.displacement->covariance() - expected).norm(), 1e-9 * expected.norm())
      << a.displacement->covariance() << "\nexpected\n"
      << expected;
}

/// A box that is taken 3 cm wrong, this way or that: residuals do not always show it.
TEST(DecisivePlace, TheCovarianceIsTrueWhereItIsOff) {
  const SE2 motion(0.1, 0.0, 0.02);
  const Eigen::Vector2d place(2.0, 0.6);
  const World before = withBoxAt(corridor(), place);
  constexpr int kRuns = 200;
  const auto outsideThreeSigma = [&](const MatcherOptions& options) {
    std::mt19937_64 random(4);
    std::normal_distribution<double> gauss(0.0, 0.03);
    int outside = 0;
    for (int run = 0; run < kRuns; ++run) {
      const Eigen::Vector2d off(gauss(random), gauss(random));
      const Scene scene{before, withBoxAt(corridor(), place + off), motion, motion, 0.2};
      const Match match = scene.match(options, static_cast<std::uint64_t>(run));
      if (!match.displacement) continue;
      const Displacement& z = *match.displacement;
      const Eigen::Matrix3d covariance = z.fromObservable() * z.covariance() * z.fromObservable().transpose();
      if (std::abs(z.reference_from_current.x - motion.x) > 3.0 * std::sqrt(covariance(0, 0))) ++outside;
    }
    return outside;
  };
  EXPECT_LE(outsideThreeSigma({}), kRuns / 100) << "of " << kRuns;
  EXPECT_GE(outsideThreeSigma(withPlaceStd(0.0)), kRuns / 20) << "of " << kRuns;
}

/// Two and a half metres ahead, as fast as the robot: alone, they would tell that it stands.
TEST(MovedPlace, WhoWalksAheadDoesNotHoldTheRobot) {
  const SE2 motion(0.15, 0.0, 0.02);
  const Scene scene{withSomebodyAt(corridor(), {2.5, 0.3}), withSomebodyAt(corridor(), {2.65, 0.3}), motion, motion};
  const Match match = scene.match();
  ASSERT_TRUE(match.displacement) << toString(match.failure);
  EXPECT_TRUE(match.place_left_out);
  EXPECT_EQ(match.displacement->dimension(), 2);
  const Eigen::Vector3d e = error(match.displacement->reference_from_current, motion);
  EXPECT_LT(std::abs(e.x()), 0.02) << "the wheels alone tell the way: " << e.transpose();
  EXPECT_LT(std::abs(e.y()), 0.01) << e.transpose();
  EXPECT_LT(std::abs(e.z()), 0.005) << e.transpose();

  MatcherOptions never;
  never.moved_place_min_share = 0.0;
  const Match held = scene.match(never);
  ASSERT_TRUE(held.displacement) << toString(held.failure);
  EXPECT_FALSE(held.place_left_out);
  EXPECT_EQ(held.displacement->dimension(), 3);
  EXPECT_LT(held.displacement->reference_from_current.x, 0.05);
}

TEST(MovedPlace, WheelsThatSlipAreContradictedByMoreThanOne) {
  const SE2 motion(0.3, 0.0, 0.02);
  const SE2 slipping(0.05, 0.0, 0.02);
  World world = withBoxAt(corridor(), {2.0, 0.6});
  world = withBoxAt(withBoxAt(std::move(world), {-1.5, -0.6}), {3.5, -0.7});
  const Match match = Scene{world, world, motion, slipping}.match();
  ASSERT_TRUE(match.displacement) << toString(match.failure);
  EXPECT_FALSE(match.place_left_out);
  EXPECT_NEAR(match.displacement->reference_from_current.x, motion.x, 0.02);
}

TEST(MovedPlace, OneThatStandsWhereTheWheelsSayIsUsed) {
  const SE2 motion(0.3, 0.0, 0.02);
  const World world = withSomebodyAt(corridor(), {2.5, 0.3});
  const Match match = Scene{world, world, motion, SE2(0.27, 0.0, 0.02)}.match();
  ASSERT_TRUE(match.displacement) << toString(match.failure);
  EXPECT_FALSE(match.place_left_out);
  EXPECT_EQ(match.displacement->dimension(), 3);
  EXPECT_NEAR(match.displacement->reference_from_current.x, motion.x, 0.02);
}

}  // namespace
}  // namespace sckf::test
