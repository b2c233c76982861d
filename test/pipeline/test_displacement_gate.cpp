#include <gtest/gtest.h>

#include <memory>
#include <utility>

#include "matching/simulated_world.h"
#include "sckf_odometry/pipeline/displacement_gate.h"

namespace sckf::test {
namespace {

constexpr double kTrunk = 0.2;  // radius [m]

/// Trunks all around, each seen by a few beams.
World grove() {
  World world;
  for (const Eigen::Vector2d& place :
       {Eigen::Vector2d(4, 1), Eigen::Vector2d(1, 5), Eigen::Vector2d(-3, 3), Eigen::Vector2d(-5, -1),
        Eigen::Vector2d(-1, -4), Eigen::Vector2d(5, -4), Eigen::Vector2d(2, -6), Eigen::Vector2d(6, 4)}) {
    world = withPost(std::move(world), place, kTrunk);
  }
  return world;
}

/// Between two walls that tell no way along them, one post that does.
World corridorWithPost() { return withPost(corridor(), {2.2, 0.8}, kTrunk); }

/// Two scans of a world, matched.
struct Seen {
  explicit Seen(const World& world, const SE2& motion = SE2(0.1, 0.02, 0.02)) {
    std::mt19937_64 random(5);
    SimulatedLaser laser;
    laser.noise = 0.01;
    reference = prepareScan(simulateScan(world, SE2(), laser, &random), laser.base_from_laser, {});
    scan = prepareScan(simulateScan(world, motion, laser, &random), laser.base_from_laser, {});
    const Eigen::Vector3d std(0.05, 0.05, 0.05);
    if (reference && scan) match = matcher.match(*reference, *scan, {motion, std.cwiseAbs2().asDiagonal()});
  }

  Comparison with(const SE2& predicted) const { return {*reference, *scan, predicted, match}; }

  /// What the points tell for the match.
  double evidence(const SE2& predicted) const {
    return matcher.fit(*reference, *scan, predicted).loss -
           matcher.fit(*reference, *scan, match.displacement->reference_from_current).loss;
  }

  ScanMatcher matcher{MatcherOptions()};
  std::shared_ptr<const PreparedScan> reference;
  std::shared_ptr<const PreparedScan> scan;
  Match match;
};

DisplacementGate gate(const GateOptions& options = {}) { return {options, ScanMatcher({})}; }

TEST(DisplacementGate, TheBoundIsThatOfTheDimension) {
  GateOptions options;
  options.probability = 0.99;
  const Seen all(room());
  const Seen corridor_only(corridor());
  ASSERT_TRUE(all.match.displacement && corridor_only.match.displacement);
  ASSERT_EQ(corridor_only.match.displacement->dimension(), 2);
  EXPECT_NEAR(gate(options).bound(*all.match.displacement), 11.345, 0.001) << "χ² with 3 degrees of freedom";
  EXPECT_NEAR(gate(options).bound(*corridor_only.match.displacement), 9.210, 0.001) << "with 2";
}

TEST(DisplacementGate, ARoomTellsAgainstWheelsThatAreWrong) {
  const Seen seen(room());
  ASSERT_TRUE(seen.match.displacement);
  for (const SE2& wrong : {SE2(0.5, 0.02, 0.02), SE2(0.1, -0.4, 0.02), SE2(0.1, 0.02, 0.3)}) {
    EXPECT_TRUE(gate().tellsAgainstPrediction(seen.with(wrong))) << wrong.vector().transpose();
    EXPECT_TRUE(gate().looksLikeSlip(seen.with(wrong))) << wrong.vector().transpose();
  }
  const SE2 right = seen.match.displacement->reference_from_current;
  EXPECT_FALSE(gate().tellsAgainstPrediction(seen.with(right)));
}

TEST(DisplacementGate, SeveralThingsTellWithLittleOnePlaceDoesNot) {
  const SE2 wrong(0.22, 0.02, 0.02);
  const Seen several(grove());
  const Seen one(corridorWithPost());
  ASSERT_TRUE(several.match.displacement && one.match.displacement);
  ASSERT_EQ(one.match.displacement->dimension(), 3);
  for (const Seen* seen : {&several, &one}) {
    EXPECT_GT(seen->evidence(wrong), 8.0);
    EXPECT_LT(seen->evidence(wrong), 40.0);
  }
  EXPECT_TRUE(gate().tellsAgainstPrediction(several.with(wrong)))
      << "evidence " << several.evidence(wrong) << ", share of a place " << several.match.decisive.share()
      << ", agreement " << several.match.agreement << ", misfit " << several.match.misfit;
  EXPECT_FALSE(gate().tellsAgainstPrediction(one.with(wrong)))
      << "evidence " << one.evidence(wrong) << ", share of a place " << one.match.decisive.share();
}

TEST(DisplacementGate, SeveralThingsThatMatchBadlyDoNot) {
  const SE2 wrong(0.22, 0.02, 0.02);
  Seen seen(grove());
  ASSERT_TRUE(gate().tellsAgainstPrediction(seen.with(wrong)));
  Match worse = seen.match;
  worse.misfit = 0.8;
  EXPECT_FALSE(gate().tellsAgainstPrediction({*seen.reference, *seen.scan, wrong, worse}));
  worse = seen.match;
  worse.agreement = 0.8;
  EXPECT_FALSE(gate().tellsAgainstPrediction({*seen.reference, *seen.scan, wrong, worse}));
}

TEST(DisplacementGate, ScansThatAreNotTrustedMakeNoSlip) {
  const Seen seen(room());
  ASSERT_TRUE(seen.match.displacement);
  const Comparison comparison = seen.with(SE2(0.5, 0.02, 0.02));
  GateOptions options;
  options.trust_scans_on_slip = false;
  EXPECT_FALSE(gate(options).looksLikeSlip(comparison));
  EXPECT_TRUE(gate(options).matchesWell(seen.match)) << "all the same";
}

TEST(DisplacementGate, OfTwoDirectionsMostPointsHaveToHaveAPartner) {
  const Seen seen(corridor());
  ASSERT_TRUE(seen.match.displacement);
  Match match = seen.match;
  match.overlap = 0.39;
  EXPECT_FALSE(gate().matchesWell(match));
  match.overlap = 0.41;
  EXPECT_TRUE(gate().matchesWell(match));
}

TEST(DisplacementGate, ScansThatAgreeOnlyHalfAreDoubtfulUnlessTheyFitNowhereElse) {
  const Seen seen(room());
  ASSERT_TRUE(seen.match.displacement);
  Match match = seen.match;
  EXPECT_FALSE(gate().isDoubtful({*seen.reference, *seen.scan, SE2(), match})) << match.agreement;
  match.agreement = 0.7;
  EXPECT_FALSE(gate().isDoubtful({*seen.reference, *seen.scan, SE2(), match})) << "it stands out";
  match.displacement->reference_from_current = SE2(1.0, 0.5, 0.4);
  EXPECT_TRUE(gate().isDoubtful({*seen.reference, *seen.scan, SE2(), match}));
}

}  // namespace
}  // namespace sckf::test
