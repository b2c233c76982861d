#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <limits>

#include "matching/crowd.h"
#include "matching/simulated_world.h"
#include "sckf_odometry/matching/scan_matcher.h"

namespace sckf::test {
namespace {

using PreparedScanPtr = std::shared_ptr<const PreparedScan>;

PreparedScanPtr prepare(const LaserScan& scan, const SimulatedLaser& laser, const ScanOptions& options = {}) {
  const auto prepared = prepareScan(scan, laser.base_from_laser, options);
  EXPECT_NE(prepared, nullptr);
  return prepared;
}

/// A prediction with an error and a covariance that allows for it.
DisplacementPrediction prediction(const SE2& truth, const Eigen::Vector3d& offset = {0.05, -0.04, 0.03}) {
  return {corrected(truth, offset), Eigen::Vector3d(0.1, 0.1, 0.1).cwiseAbs2().asDiagonal()};
}

Match matchIn(const World& world, const SE2& world_from_reference, const SE2& displacement, const SimulatedLaser& laser,
              const DisplacementPrediction& expected, std::mt19937_64* random = nullptr,
              const MatcherOptions& options = {}) {
  const auto reference = prepare(simulateScan(world, world_from_reference, laser, random), laser);
  const auto current = prepare(simulateScan(world, compose(world_from_reference, displacement), laser, random), laser);
  return ScanMatcher(options).match(*reference, *current, expected);
}

const SE2 kDisplacement(0.4, -0.1, 0.2);

TEST(ScanMatcher, FindsTheDisplacementInARoom) {
  const Match match = matchIn(room(), SE2(), kDisplacement, SimulatedLaser(), prediction(kDisplacement));
  ASSERT_TRUE(match.displacement) << toString(match.failure);
  EXPECT_EQ(match.displacement->dimension(), 3);
  EXPECT_GT(match.overlap, 0.8);
  const Eigen::Vector3d e = error(match.displacement->reference_from_current, kDisplacement);
  EXPECT_LT(e.cwiseAbs().maxCoeff(), 2e-3) << "error " << e.transpose();
}

TEST(ScanMatcher, ThePredictionDoesNotEnterWhatTheScansSee) {
  const Match a = matchIn(room(), SE2(), kDisplacement, SimulatedLaser(), prediction(kDisplacement));
  const Match b =
      matchIn(room(), SE2(), kDisplacement, SimulatedLaser(), prediction(kDisplacement, {-0.08, 0.06, -0.05}));
  ASSERT_TRUE(a.displacement && b.displacement);
  const Eigen::Vector3d difference =
      error(a.displacement->reference_from_current, b.displacement->reference_from_current);
  EXPECT_LT(difference.cwiseAbs().maxCoeff(), 1e-3) << "difference " << difference.transpose();
}

TEST(ScanMatcher, FindsAYawThatTheWheelsMissed) {
  const Match match = matchIn(room(), SE2(), SE2(0.1, 0.0, 0.45), SimulatedLaser(), prediction(SE2(0.1, 0.0, 0.1)));
  ASSERT_TRUE(match.displacement) << toString(match.failure);
  EXPECT_NEAR(match.displacement->reference_from_current.yaw, 0.45, 2e-3);
}

/// Farther from the prediction than is searched.
TEST(ScanMatcher, FindsARobotThatReversesWhereTheWheelsLoseTheSign) {
  for (const double way : {0.9, 1.2}) {
    const SE2 back(-way, 0.02, 0.1);
    const DisplacementPrediction forth{SE2(way, 0.0, 0.12), Eigen::Vector3d(0.05, 0.05, 0.02).cwiseAbs2().asDiagonal()};
    const Match match = matchIn(room(), SE2(0.6, 0.2, 0.3), back, SimulatedLaser(), forth);
    ASSERT_TRUE(match.displacement) << way << ": " << toString(match.failure);
    const Eigen::Vector3d e = error(match.displacement->reference_from_current, back);
    EXPECT_LT(e.cwiseAbs().maxCoeff(), 2e-3) << way << ": error " << e.transpose();
  }
}

TEST(ScanMatcher, AMountAheadGivesTheDisplacementOfTheBase) {
  SimulatedLaser laser;
  laser.base_from_laser.translation() << 0.5, 0.1, 0.3;
  laser.base_from_laser.rotate(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()));  // upside down
  const Match match = matchIn(room(), SE2(), kDisplacement, laser, prediction(kDisplacement));
  ASSERT_TRUE(match.displacement) << toString(match.failure);
  const Eigen::Vector3d e = error(match.displacement->reference_from_current, kDisplacement);
  EXPECT_LT(e.cwiseAbs().maxCoeff(), 2e-3) << "error " << e.transpose();
}

TEST(ScanMatcher, ScansMayHaveDifferentNumbersOfBeams) {
  SimulatedLaser coarse;
  coarse.beams = 181;
  coarse.angle_increment = 2.0 * M_PI / 181.0;
  const SimulatedLaser fine;
  const auto reference = prepare(simulateScan(room(), SE2(), coarse), coarse);
  const auto current = prepare(simulateScan(room(), kDisplacement, fine), fine);
  const Match match = ScanMatcher(MatcherOptions()).match(*reference, *current, prediction(kDisplacement));
  ASSERT_TRUE(match.displacement) << toString(match.failure);
  EXPECT_EQ(match.displacement->J_reference.cols(), 181);
  EXPECT_EQ(match.displacement->variance_reference.size(), 181);
  EXPECT_EQ(match.displacement->J_current.cols(), 361);
  EXPECT_EQ(match.displacement->variance_current.size(), 361);
  const Eigen::Vector3d e = error(match.displacement->reference_from_current, kDisplacement);
  EXPECT_LT(e.cwiseAbs().maxCoeff(), 5e-3) << "error " << e.transpose();
}

/// The Jacobian by central differences of the whole matcher: one range changed, everything done again.
class Jacobians : public ::testing::Test {
 protected:
  void SetUp() override {
    std::mt19937_64 random(11);
    laser_.noise = 0.01;
    reference_ = simulateScan(room(), SE2(), laser_, &random);
    current_ = simulateScan(room(), kDisplacement, laser_, &random);
    // What is estimated from the scan as a whole is held: the derivative is by the ranges at a given noise.
    options_.range_noise_min = options_.range_noise_max = 0.01;
  }

  Match match(const LaserScan& reference, const LaserScan& current) const {
    return ScanMatcher(MatcherOptions())
        .match(*prepare(reference, laser_, options_), *prepare(current, laser_, options_), prediction(kDisplacement));
  }

  Eigen::Vector3d numericalColumn(bool of_reference, std::size_t beam) const {
    const float h = 1e-4F;
    const auto at = [&](float change) {
      LaserScan reference = reference_;
      LaserScan current = current_;
      (of_reference ? reference : current).ranges[beam] += change;
      const Match result = match(reference, current);
      EXPECT_TRUE(result.displacement);
      return result.displacement->reference_from_current;
    };
    const LaserScan& changed = of_reference ? reference_ : current_;
    const double span = static_cast<double>(changed.ranges[beam] + h) - static_cast<double>(changed.ranges[beam] - h);
    return error(at(h), at(-h)) / span;
  }

  void compare(bool of_reference) {
    const Match nominal = match(reference_, current_);
    ASSERT_TRUE(nominal.displacement);
    ASSERT_EQ(nominal.displacement->dimension(), 3);
    const Eigen::Matrix3Xd J = nominal.displacement->observable.inverse() *
                               (of_reference ? nominal.displacement->J_reference : nominal.displacement->J_current);
    Eigen::Matrix3Xd numerical(3, 0);
    Eigen::Matrix3Xd analytical(3, 0);
    for (std::size_t beam = 0; beam < reference_.ranges.size(); beam += 5) {
      numerical.conservativeResize(3, numerical.cols() + 1);
      analytical.conservativeResize(3, analytical.cols() + 1);
      numerical.rightCols<1>() = numericalColumn(of_reference, beam);
      analytical.rightCols<1>() = J.col(static_cast<Eigen::Index>(beam));
    }
    for (int row = 0; row < 3; ++row) {
      const Eigen::VectorXd difference = numerical.row(row) - analytical.row(row);
      // A range may move a point to another partner or a surface to another length: single columns jump, so the median
      // tells about the derivative and the norm about the whole.
      Eigen::VectorXd sorted = difference.cwiseAbs();
      std::sort(sorted.data(), sorted.data() + sorted.size());
      const double scale = numerical.row(row).norm() / std::sqrt(static_cast<double>(numerical.cols()));
      EXPECT_LT(sorted(sorted.size() / 2), 0.03 * scale) << "row " << row;
      EXPECT_LT(difference.norm(), 0.15 * numerical.row(row).norm()) << "row " << row;
    }
  }

  SimulatedLaser laser_;
  LaserScan reference_;
  LaserScan current_;
  ScanOptions options_;
};

TEST_F(Jacobians, ByTheRangesOfTheReferenceAgreeWithTheMatcherItself) { compare(true); }
TEST_F(Jacobians, ByTheRangesOfTheCurrentScanAgreeWithTheMatcherItself) { compare(false); }

TEST_F(Jacobians, OfARangeThatIsNotUsedAreZero) {
  reference_.ranges[40] = std::numeric_limits<float>::quiet_NaN();
  current_.ranges[41] = std::numeric_limits<float>::infinity();
  const Match result = match(reference_, current_);
  ASSERT_TRUE(result.displacement);
  EXPECT_EQ(result.displacement->J_reference.col(40).norm(), 0.0);
  EXPECT_EQ(result.displacement->J_current.col(41).norm(), 0.0);
}

/// Errors of many matches of noisy scans, in the directions that the scans see, beside what the matcher says of them.
struct MonteCarlo {
  Eigen::MatrixXd sample;   // covariance of the errors
  Eigen::MatrixXd claimed;  // mean of the covariances
  Eigen::VectorXd mean;     // of the errors
  int failures = 0;
};

MonteCarlo monteCarlo(const World& world, const SE2& displacement, double noise, int runs, Eigen::Index dimension,
                      const MatcherOptions& options = {}) {
  std::mt19937_64 random(7);
  SimulatedLaser laser;
  laser.noise = noise;
  // Fixed combinations of x, y, yaw: the matcher's own basis turns with the noise.
  Eigen::MatrixXd seen = Eigen::MatrixXd::Identity(3, 3);
  if (dimension == 2) seen = (Eigen::MatrixXd(2, 3) << 0, 1, 0, 0, 0, 1).finished();
  MonteCarlo result{Eigen::MatrixXd::Zero(dimension, dimension), Eigen::MatrixXd::Zero(dimension, dimension),
                    Eigen::VectorXd::Zero(dimension)};
  int used = 0;
  for (int run = 0; run < runs; ++run) {
    const Match match = matchIn(world, SE2(), displacement, laser, prediction(displacement), &random, options);
    if (!match.displacement || match.displacement->dimension() != dimension) {
      ++result.failures;
      continue;
    }
    const Displacement& z = *match.displacement;
    const Eigen::VectorXd e = seen * error(z.reference_from_current, displacement);
    const Eigen::MatrixXd V = z.observable.completeOrthogonalDecomposition().pseudoInverse();
    result.sample += e * e.transpose();
    result.mean += e;
    result.claimed += seen * V * z.covariance() * V.transpose() * seen.transpose();
    ++used;
  }
  result.mean /= used;
  result.sample = (result.sample / used - result.mean * result.mean.transpose()).eval();
  result.claimed /= used;
  return result;
}

/// Nothing in these worlds is off or moves: what the decisive place may be off by is tested with it.
MatcherOptions inflating(double matching_noise) {
  MatcherOptions options;
  options.estimation.matching_inflation = matching_noise;
  options.estimation.place_std = 0.0;
  return options;
}

/// Claimed over seen, as std, of each axis.
void expectRatios(const MonteCarlo& result, double least, double most) {
  EXPECT_EQ(result.failures, 0) << "matches that failed, or saw another number of directions";
  for (Eigen::Index axis = 0; axis < result.mean.size(); ++axis) {
    const double claimed = std::sqrt(result.claimed(axis, axis));
    const double seen = std::sqrt(result.sample(axis, axis));
    EXPECT_GT(claimed / seen, least) << "axis " << axis << ", claimed std " << claimed << ", seen " << seen;
    EXPECT_LT(claimed / seen, most) << "axis " << axis << ", claimed std " << claimed << ", seen " << seen;
  }
}

/// What the match differs by from that with the roles exchanged counts for matching noise, which there is none of here.
TEST(Covariance, AgreesWithMonteCarloInARoom) {
  const MonteCarlo result = monteCarlo(room(), SE2(0.2, 0.05, 0.1), 0.02, 400, 3, inflating(1.0));
  expectRatios(result, 0.8, 1.25);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_LT(std::abs(result.mean(axis)), std::sqrt(result.sample(axis, axis))) << "bias of axis " << axis;
  }
}

/// Straight walls have no matching noise; now and then it seems as if, and counts three times, more than by default.
TEST(Covariance, IsHardlyTooLargeWhereThereIsNoMatchingNoise) {
  expectRatios(monteCarlo(room(), SE2(0.2, 0.05, 0.1), 0.02, 400, 3, inflating(3.0)), 0.85, 1.35);
}

/// Nor is anything off by what the place that decides most may be off by.
TEST(Covariance, IsTooLargeByWhatAPlaceMayBeOffBy) {
  expectRatios(monteCarlo(room(), SE2(0.2, 0.05, 0.1), 0.02, 400, 3), 0.85, 1.85);
}

/// Of the scans of one pair, matched each way.
Displacement someDisplacement(const SE2& displacement, const Eigen::Matrix3d& observable, double slope) {
  Displacement z;
  z.reference_from_current = displacement;
  z.observable = observable;
  z.J_reference = Eigen::Vector3d(slope, 0.0, 0.1);
  z.J_current = (Eigen::Matrix<double, 3, 2>() << 0.0, slope, 0.2, 0.0, 0.0, 0.3).finished();
  z.variance_reference = Eigen::VectorXd::Constant(1, 1e-4);
  z.variance_current = Eigen::VectorXd::Constant(2, 4e-4);
  z.matching_noise = 1e-4 * Eigen::Matrix3d::Identity();
  return z;
}

TEST(BothWays, TheMeanOfTwoThatAgreeIsEither) {
  const Displacement there =
      someDisplacement(SE2(0.3, 0.1, 0.2), Eigen::Vector3d(1.0, 2.0, 3.0).asDiagonal().toDenseMatrix(), 0.5);
  // The same error the other way round: by the inverse's Jacobian, in coordinates of its own.
  Displacement back = there;
  Eigen::Matrix3d J;
  back.reference_from_current = inverse(there.reference_from_current, &J);
  back.observable << 1.0, 0.2, 0.0, 0.0, 0.5, 0.0, 0.1, 0.0, 2.0;
  const Eigen::Matrix3d by_there = Eigen::Matrix3d(back.observable) * J * Eigen::Matrix3d(there.observable).inverse();
  back.J_reference = by_there * there.J_current;
  back.J_current = by_there * there.J_reference;
  back.matching_noise = by_there * there.matching_noise * by_there.transpose();
  std::swap(back.variance_reference, back.variance_current);
  const Displacement mean = meanOfBothWays(there, back);
  EXPECT_LT(error(mean.reference_from_current, there.reference_from_current).norm(), 1e-12);
  EXPECT_LT((mean.J_reference - there.J_reference).norm(), 1e-12) << mean.J_reference;
  EXPECT_LT((mean.J_current - there.J_current).norm(), 1e-12) << mean.J_current;
  EXPECT_LT((mean.matching_noise - there.matching_noise).norm(), 1e-12) << mean.matching_noise;
  EXPECT_LT((mean.covariance() - there.covariance()).norm(), 1e-12) << mean.covariance();
}

TEST(BothWays, WhatTheyDifferByIsNoise) {
  const Displacement there = someDisplacement(SE2(0.3, 0.0, 0.0), Eigen::Matrix3d::Identity(), 0.5);
  Displacement back = someDisplacement(SE2(-0.34, 0.02, 0.0), Eigen::Matrix3d::Identity(), 0.5);
  back.J_current = Eigen::Vector3d(0.7, 0.0, 0.0);
  back.J_reference = Eigen::MatrixXd::Zero(3, 2);
  const Displacement mean = meanOfBothWays(there, back);
  EXPECT_LT(error(mean.reference_from_current, SE2(0.32, -0.01, 0.0)).norm(), 1e-12);
  EXPECT_NEAR(mean.J_reference(0, 0), 0.5 * (0.5 - 0.7), 1e-12) << "⊖ turns the sign";
  const Eigen::Vector3d difference(0.04, -0.02, 0.0);
  // ⊖ moves y by x times yaw: the noise of back's yaw is in y.
  Eigen::Matrix3d expected = 1e-4 * Eigen::Matrix3d::Identity() + 0.5 * difference * difference.transpose();
  Eigen::Matrix3d J;
  inverse(back.reference_from_current, &J);
  expected += 0.5e-4 * (J * J.transpose() - Eigen::Matrix3d::Identity());
  EXPECT_LT((mean.matching_noise - expected).norm(), 1e-12) << mean.matching_noise << "\nexpected\n" << expected;
}

/// Slanting walls as stairs, as a grid map has them: what beams on one step err by they err by together.
World stairs(const World& smooth, double step) {
  const auto cornerOf = [step](const Eigen::Vector2d& p) -> Eigen::Vector2d {
    return step * (Eigen::Rotation2Dd(0.5) * p / step).array().round().matrix();
  };
  World world;
  for (const Wall& wall : smooth) {
    const int steps = static_cast<int>((wall.to - wall.from).norm() / step);
    Eigen::Vector2d from = cornerOf(wall.from);
    for (int i = 1; i <= steps; ++i) {
      const Eigen::Vector2d to = cornerOf(wall.from + (wall.to - wall.from) * i / steps);
      const Eigen::Vector2d edge(to.x(), from.y());
      if (edge != from) world.push_back({from, edge});
      if (to != edge) world.push_back({edge, to});
      from = to;
    }
  }
  return world;
}

/// Of displacements one way among stairs, with the noise of ranges alone or with so many times the matching noise seen.
struct AmongStairs {
  explicit AmongStairs(double inflation) {
    const World world = stairs(room(), 0.15);
    SimulatedLaser laser;
    laser.noise = 0.005;
    MatcherOptions options = inflating(inflation);
    options.both_ways = false;
    constexpr int kRuns = 300;
    for (int i = 0; i < kRuns; ++i) {
      std::mt19937_64 random(static_cast<std::uint64_t>(i));
      std::uniform_real_distribution<double> within(-1.0, 1.0);
      const SE2 start(within(random), within(random), 3.0 * within(random));
      const SE2 motion(0.5 * within(random), 0.1 * within(random), 0.4 * within(random));
      const Match match = matchIn(world, start, motion, laser, prediction(motion), &random, options);
      if (!match.displacement || match.displacement->dimension() != 3) continue;
      const Displacement& z = *match.displacement;
      const Eigen::Vector3d e = z.observable * error(z.reference_from_current, motion);
      nees += e.dot(z.covariance().ldlt().solve(e)) / kRuns;
      matching_noise.push_back(z.matching_noise);
    }
  }

  double nees = 0.0;  // mean
  std::vector<Eigen::Matrix3d> matching_noise;
};

TEST(MatchingNoise, IsWhatRangeNoiseDoesNotExplainTimesItsInflation) {
  const AmongStairs none(0.0);
  const AmongStairs seen(1.0);
  const AmongStairs thrice(3.0);
  ASSERT_EQ(seen.matching_noise.size(), 300U);
  ASSERT_EQ(thrice.matching_noise.size(), 300U);
  int scattering = 0;
  for (std::size_t i = 0; i < 300; ++i) {
    const double norm = thrice.matching_noise[i].norm();
    EXPECT_EQ(none.matching_noise[i].norm(), 0.0) << i;
    EXPECT_LE((thrice.matching_noise[i] - 3.0 * seen.matching_noise[i]).norm(), 1e-9 * norm) << i;
    if (norm > 0.0) ++scattering;
  }
  EXPECT_GT(scattering, 200);
  EXPECT_GT(none.nees, 3.3) << "3 is right: range noise alone does not explain stairs";
  EXPECT_LT(seen.nees, 3.0);
  EXPECT_LT(thrice.nees, seen.nees);
}

/// The mean of what matches at sixty places tell, each by its information. told_at: what the match of a place tells.
template <typename ToldAt>
ConstantEvidence meanTold(const ToldAt& told_at) {
  ConstantEvidence mean;
  for (int i = 0; i < 60; ++i) {
    std::mt19937_64 random(static_cast<std::uint64_t>(i));
    std::uniform_real_distribution<double> within(-1.0, 1.0);
    const SE2 start(within(random), within(random), 3.0 * within(random));
    const SE2 motion(0.5 * within(random), 0.1 * within(random), 0.4 * within(random));
    const ConstantEvidence told = told_at(start, motion, random);
    mean.information += told.information;
    mean.value += told.information * told.value;
    mean.bias_std += told.information * told.bias_std;
  }
  EXPECT_GT(mean.information, 0.0);
  return {mean.value / mean.information, mean.information, mean.bias_std / mean.information};
}

ConstantEvidence rangeOffsetTold(double offset, double noise) {
  SimulatedLaser laser;
  laser.noise = noise;
  laser.offset = offset;
  return meanTold([&laser](const SE2& start, const SE2& motion, std::mt19937_64& random) {
    const Match match = matchIn(room(), start, motion, laser, prediction(motion), &random);
    EXPECT_TRUE(match.displacement) << toString(match.failure);
    return match.range_offset;
  });
}

TEST(RangeOffset, IsToldByHowScansFallTogether) {
  for (const double noise : {0.005, 0.01, 0.02}) {
    const ConstantEvidence none = rangeOffsetTold(0.0, noise);
    for (const double offset : {0.02, -0.02}) {
      const ConstantEvidence told = rangeOffsetTold(offset, noise);
      EXPECT_NEAR(told.value - none.value, -offset, 0.2 * std::abs(offset)) << "range noise " << noise;
    }
  }
}

/// Their noise biases what matches tell, the more the larger it is.
TEST(RangeOffset, WhatNoiseTellsOfItIsAllowedFor) {
  for (const double noise : {0.01, 0.02}) {
    const ConstantEvidence none = rangeOffsetTold(0.0, noise);
    EXPECT_NEAR(none.bias_std, 24.0 * noise * noise, 4.0 * noise * noise)
        << "of the noisier scan: 20 times its variance";
    EXPECT_LT(std::abs(none.value), 3.0 * none.bias_std + 2.0 / std::sqrt(none.information)) << "noise " << noise;
  }
}

TEST(RangeOffset, ScansThatDoNotSeeAllDirectionsTellNothingOfIt) {
  const Match match = matchIn(corridor(), SE2(), SE2(0.4, 0.0, 0.05), frontLaser(), prediction(SE2(0.4, 0.0, 0.05)));
  ASSERT_TRUE(match.displacement) << toString(match.failure);
  ASSERT_EQ(match.displacement->dimension(), 2);
  EXPECT_EQ(match.range_offset.information, 0.0);
}

/// Of scans whose sweeps take so long, about their stamps, while the robot makes the motion from one to the next within
/// 0.4 s; so much of the duration has been undone.
ConstantEvidence sweepDurationTold(double duration, double undone) {
  SimulatedLaser laser;
  laser.noise = 0.01;
  laser.time_increment = duration / (laser.beams - 1);
  return meanTold([&](const SE2& start, const SE2& motion, std::mt19937_64& random) {
    ScanOptions options;
    options.sweep = {motion.vector() / 0.4, undone};
    const auto swept = [&](const SE2& world_from_base) {
      const auto along = [&](double t) {
        return compose(world_from_base, SE2((t - 0.5 * duration) * options.sweep.twist));
      };
      return prepareScan(simulateSweep(room(), along, laser, &random), laser.base_from_laser, options);
    };
    const auto reference = swept(start);
    const auto current = swept(compose(start, motion));
    const Match match = ScanMatcher({}).match(*reference, *current, prediction(motion));
    EXPECT_TRUE(match.displacement) << toString(match.failure);
    EXPECT_EQ(match.sweep_duration.bias_std, 0.005);
    return match.sweep_duration;
  });
}

TEST(SweepDuration, IsToldByHowScansFallTogether) {
  for (const double duration : {0.05, -0.05, 0.0}) {
    for (const double undone : {0.0, 0.02}) {
      const ConstantEvidence told = sweepDurationTold(duration, undone);
      EXPECT_NEAR(told.value, duration - undone, 0.006) << duration << " s, of which are undone " << undone;
      EXPECT_LT(1.0 / std::sqrt(told.information), 0.003);
    }
  }
}

TEST(SweepDuration, ARobotThatStandsTellsNothingOfIt) {
  const Match match = matchIn(room(), SE2(), kDisplacement, SimulatedLaser(), prediction(kDisplacement));
  ASSERT_TRUE(match.displacement) << toString(match.failure);
  EXPECT_EQ(match.sweep_duration.information, 0.0);
}

TEST(BothWays, ErrLessThanOneAmongRoughWalls) {
  const World world = rough(room(), 0.03);
  SimulatedLaser laser;
  laser.beams = 181;
  laser.angle_increment = 2.0 * M_PI / 181.0;
  laser.noise = 0.02;
  MatcherOptions one_way;
  one_way.both_ways = false;
  Eigen::Vector3d both = Eigen::Vector3d::Zero();
  Eigen::Vector3d one = Eigen::Vector3d::Zero();
  for (int i = 0; i < 150; ++i) {
    std::mt19937_64 random(static_cast<std::uint64_t>(i));
    std::uniform_real_distribution<double> within(-1.0, 1.0);
    const SE2 start(within(random), within(random), 3.0 * within(random));
    const SE2 motion(0.5 * within(random), 0.1 * within(random), 0.4 * within(random));
    std::mt19937_64 again = random;
    const Match a = matchIn(world, start, motion, laser, prediction(motion), &random);
    const Match b = matchIn(world, start, motion, laser, prediction(motion), &again, one_way);
    ASSERT_TRUE(a.displacement && b.displacement) << i;
    both += error(a.displacement->reference_from_current, motion).cwiseAbs2();
    one += error(b.displacement->reference_from_current, motion).cwiseAbs2();
  }
  const Eigen::Vector3d ratio = both.cwiseQuotient(one);
  EXPECT_LT(ratio.head<2>().maxCoeff(), 0.92)
      << "mean square errors in x, y, yaw, both ways over one: " << ratio.transpose();
  EXPECT_LT(ratio.z(), 1.05);
}

TEST(Covariance, AgreesWithMonteCarloAcrossACorridor) {
  // Rather too large than too small: a block of beams at the end of the view weighs much.
  expectRatios(monteCarlo(corridor(), SE2(0.3, 0.05, 0.05), 0.02, 400, 2, inflating(1.0)), 0.85, 1.25);
  expectRatios(monteCarlo(corridor(), SE2(0.3, 0.05, 0.05), 0.02, 400, 2, inflating(3.0)), 0.85, 1.4);
}

TEST(Observability, ACorridorTellsNothingAlongIt) {
  std::mt19937_64 random(5);
  for (const double noise : {0.0, 0.01, 0.03}) {
    SimulatedLaser laser;
    laser.noise = noise;
    const SE2 truth(0.4, 0.0, 0.1);
    const Match match = matchIn(corridor(), SE2(0.0, 0.2, 0.0), truth, laser, prediction(truth), &random);
    ASSERT_TRUE(match.displacement) << toString(match.failure);
    ASSERT_EQ(match.displacement->dimension(), 2) << "noise " << noise;
    const Eigen::Vector3d along(1.0, 0.0, 0.0);
    EXPECT_LT((match.displacement->observable * along).norm(), 0.1) << "noise " << noise;
    // Where the scans see nothing, the prediction stays: its error of 5 cm along, none of it across.
    EXPECT_NEAR(match.displacement->reference_from_current.x, truth.x + 0.05, 0.02);
    EXPECT_NEAR(match.displacement->reference_from_current.y, truth.y, 0.01);
  }
}

TEST(Observability, ARoundRoomTellsNothingAboutYaw) {
  std::vector<Eigen::Vector2d> corners;
  for (int i = 0; i < 720; ++i)
    corners.emplace_back(4.0 * std::cos(i * M_PI / 360.0), 4.0 * std::sin(i * M_PI / 360.0));
  std::mt19937_64 random(6);
  SimulatedLaser laser;
  laser.noise = 0.01;
  const SE2 truth(0.2, 0.1, 0.15);
  const Match match = matchIn(closedPolygon(corners), SE2(), truth, laser, prediction(truth), &random);
  ASSERT_TRUE(match.displacement) << toString(match.failure);
  EXPECT_EQ(match.displacement->dimension(), 2);
}

/// One short wall, 0.8 m wide and 2 m ahead: it tells the distance well, the yaw badly, and nothing along itself.
TEST(Observability, WhatIsNotKnownWellEnoughIsNotSeen) {
  const World world{{{2.0, -0.4}, {2.0, 0.4}}};
  std::mt19937_64 random(8);
  SimulatedLaser laser;
  laser.beams = 720;
  laser.angle_increment = M_PI / 360.0;
  laser.noise = 0.02;
  const SE2 truth(0.05, 0.0, 0.0);
  const auto reference = prepare(simulateScan(world, SE2(), laser, &random), laser);
  const auto current = prepare(simulateScan(world, truth, laser, &random), laser);
  const auto dimensionFor = [&](double max_std) {
    MatcherOptions options;
    options.estimation.observability.max_std = max_std;
    const Match match = ScanMatcher(options).match(*reference, *current, prediction(truth, {0.02, 0.0, 0.01}));
    EXPECT_EQ(match.failure == MatchFailure::kNotObservable, !match.displacement) << toString(match.failure);
    return match.displacement ? match.displacement->dimension() : 0;
  };
  EXPECT_EQ(dimensionFor(1.0), 2);
  EXPECT_EQ(dimensionFor(0.02), 1);
  EXPECT_EQ(dimensionFor(1e-6), 0);
}

TEST(Failures, ScansOfDifferentPlacesDoNotMatch) {
  const SimulatedLaser laser;
  const World far_room = closedPolygon({{-12.0, -11.0}, {13.0, -11.0}, {13.0, 14.0}, {-12.0, 14.0}});
  const auto reference = prepare(simulateScan(room(), SE2(), laser), laser);
  const auto current = prepare(simulateScan(far_room, SE2(), laser), laser);
  const Match match = ScanMatcher(MatcherOptions()).match(*reference, *current, prediction(SE2()));
  EXPECT_FALSE(match.displacement);
  EXPECT_EQ(match.failure, MatchFailure::kTooFewPairs) << toString(match.failure);
}

TEST(Failures, TooSmallAShareOfPairsIsNoOverlap) {
  MatcherOptions options;
  options.min_overlap = 1.0;
  const SimulatedLaser laser;
  const auto reference = prepare(simulateScan(room(), SE2(), laser), laser);
  const auto current = prepare(simulateScan(room(), kDisplacement, laser), laser);
  const Match match = ScanMatcher(options).match(*reference, *current, prediction(kDisplacement));
  EXPECT_FALSE(match.displacement);
  EXPECT_EQ(match.failure, MatchFailure::kNoOverlap) << toString(match.failure);
}

TEST(Failures, AnEstimateFarFromTheAlignmentDiverged) {
  MatcherOptions options;
  options.max_refinement = 1e-12;
  const SimulatedLaser laser;
  const auto reference = prepare(simulateScan(room(), SE2(), laser), laser);
  const auto current = prepare(simulateScan(room(), kDisplacement, laser), laser);
  const Match match = ScanMatcher(options).match(*reference, *current, prediction(kDisplacement));
  EXPECT_FALSE(match.displacement);
  EXPECT_EQ(match.failure, MatchFailure::kDiverged) << toString(match.failure);
}

TEST(Failures, ScansThatAgreeTooLittleContradictEachOther) {
  const SimulatedLaser laser;
  const World with_pillar = room();
  const World without_pillar(with_pillar.begin(), with_pillar.end() - 4);
  const auto reference = prepare(simulateScan(room(), SE2(), laser), laser);
  const auto current = prepare(simulateScan(without_pillar, SE2(), laser), laser);
  MatcherOptions options;
  const Match match = ScanMatcher(options).match(*reference, *current, prediction(SE2()));
  ASSERT_TRUE(match.displacement) << toString(match.failure);
  EXPECT_GT(match.agreement, 0.8);
  EXPECT_LT(match.agreement, 0.98);
  options.min_agreement = match.agreement + 0.01;
  const Match refused = ScanMatcher(options).match(*reference, *current, prediction(SE2()));
  EXPECT_FALSE(refused.displacement);
  EXPECT_EQ(refused.failure, MatchFailure::kContradiction) << toString(refused.failure);
}

// ---- a right prediction

/// Along x, 2.4 m wide, with doors of 1 m that are set back by 12 cm on either side.
World corridorWithDoors() {
  World world;
  for (const double side : {-1.0, 1.0}) {
    for (int i = -12; i < 12; ++i) {
      const double from = 2.7 * i + (side > 0.0 ? 0.0 : 0.9);
      const double wall = 1.2 * side;
      const double door = 1.32 * side;
      world.push_back({{from, wall}, {from + 1.7, wall}});
      world.push_back({{from + 1.7, wall}, {from + 1.7, door}});
      world.push_back({{from + 1.7, door}, {from + 2.7, door}});
      world.push_back({{from + 2.7, door}, {from + 2.7, wall}});
    }
  }
  return world;
}

/// A laser that looks ahead sees walls beside the robot that it did not see before: a third of its points have no
/// partner, and more would where it is not.
TEST(RightPrediction, IsKeptWhereTheRobotDrivesBack) {
  std::mt19937_64 random(5);
  const World world = corridorWithDoors();
  for (int i = 0; i < 20; ++i) {
    const SE2 from(0.31 * i - 3.0, 0.1, 0.02);
    const SE2 back(-1.0, 0.02, 0.05 - 0.005 * i);
    const Match match = matchIn(world, from, back, frontLaser(), prediction(back, {0.03, -0.02, 0.02}), &random);
    ASSERT_TRUE(match.displacement) << i << ": " << toString(match.failure);
    EXPECT_LT(match.overlap, 0.75) << i;
    EXPECT_GT(match.agreement, 0.95) << i;
    const Eigen::Vector3d e = error(match.displacement->reference_from_current, back);
    EXPECT_LT(std::abs(e.x()), 0.1) << i << ": " << e.transpose();
    EXPECT_LT(std::abs(e.y()), 0.02) << i << ": " << e.transpose();
    EXPECT_LT(std::abs(e.z()), 0.01) << i << ": " << e.transpose();
  }
}

TEST(Failures, EveryReasonHasItsWords) {
  for (const MatchFailure failure : {MatchFailure::kTooFewPairs, MatchFailure::kNoOverlap, MatchFailure::kContradiction,
                                     MatchFailure::kDiverged, MatchFailure::kNotObservable}) {
    EXPECT_NE(toString(failure), "unknown");
    EXPECT_NE(toString(failure), "none");
  }
}

/// Thick trunks here and there, from 2 to 14 m away.
World trees() {
  World world;
  for (int k = 0; k < 60; ++k) {
    const double distance = 2.0 + 0.2 * k;
    const Eigen::Vector2d trunk(distance * std::cos(2.4 * k), distance * std::sin(2.4 * k));
    const double angle = 0.7 * k;
    std::vector<Eigen::Vector2d> corners;
    for (int corner = 0; corner < 5; ++corner)
      corners.push_back(trunk +
                        0.35 * Eigen::Vector2d(std::cos(angle + 1.26 * corner), std::sin(angle + 1.26 * corner)));
    world = withPolygon(std::move(world), corners);
  }
  return world;
}

TEST(Refutes, WhereScansCannotLieSo) {
  SimulatedLaser ahead;
  ahead.beams = 181;
  ahead.angle_min = -M_PI_2;
  ahead.angle_increment = M_PI / 180.0;
  std::mt19937_64 random(1);
  const auto at = [&](const SE2& pose) { return prepare(simulateScan(trees(), pose, ahead, &random), ahead); };
  const SE2 turned(0.0, 0.0, 0.3);
  const ScanMatcher matcher{MatcherOptions()};
  const auto reference = at(SE2());
  const auto current = at(turned);
  EXPECT_FALSE(matcher.refutes(*reference, *current, turned)) << "where they truly lie";
  EXPECT_FALSE(matcher.refutes(*reference, *current, corrected(turned, {0.05, 0.0, 0.01}))) << "or nearly";
  EXPECT_TRUE(matcher.refutes(*reference, *current, SE2())) << "as wheels tell that do not turn";
  const SE2 back(0.0, 0.0, M_PI);
  EXPECT_FALSE(matcher.refutes(*reference, *at(back), back)) << "who has turned round sees other trees";
}

TEST(StandsOut, WhatIsSeenAgainAndNotACrowd) {
  SimulatedLaser laser;
  laser.noise = 0.01;
  std::mt19937_64 random(1);
  const SE2 moved(0.5, 0.1, 0.3);
  const ScanMatcher matcher{MatcherOptions()};
  for (const World& world : {trees(), room()}) {
    const auto reference = prepare(simulateScan(world, SE2(), laser, &random), laser);
    const auto current = prepare(simulateScan(world, moved, laser, &random), laser);
    EXPECT_TRUE(matcher.standsOut(*reference, *current, moved));
    EXPECT_FALSE(matcher.standsOut(*reference, *current, corrected(moved, {0.0, 0.5, 0.2})));
  }
  MatcherOptions whatever;
  whatever.min_agreement = 0.0;
  int matched = 0;
  for (int i = 0; i < 20; ++i) {
    const LaserScan empty = simulateScan(room(), SE2(), laser);
    const auto reference = prepare(amongPeople(empty, random), laser);
    const auto current = prepare(amongPeople(empty, random), laser);
    const Match match =
        ScanMatcher(whatever).match(*reference, *current, {moved, Eigen::Vector3d(0.25, 0.25, 0.25).asDiagonal()});
    if (!match.displacement) continue;
    ++matched;
    EXPECT_FALSE(matcher.standsOut(*reference, *current, match.displacement->reference_from_current)) << i;
  }
  EXPECT_GT(matched, 10) << "somehow";
}

TEST(Fits, BestWhereScansTrulyLie) {
  SimulatedLaser laser;
  laser.noise = 0.01;
  std::mt19937_64 random(1);
  const SE2 moved(0.3, 0.1, 0.2);
  const auto reference = prepare(simulateScan(room(), SE2(), laser, &random), laser);
  const auto current = prepare(simulateScan(room(), moved, laser, &random), laser);
  const ScanMatcher matcher{MatcherOptions()};
  const Fit there = matcher.fit(*reference, *current, moved);
  const Fit elsewhere = matcher.fit(*reference, *current, corrected(moved, {0.0, 0.4, 0.0}));
  EXPECT_GT(there.overlap, 0.95);
  EXPECT_GT(there.agreement, 0.98);
  EXPECT_LT(there.contradictions, 5);
  EXPECT_LT(there.loss, 361.0) << "of residuals of one standard deviation half of that";
  EXPECT_LT(elsewhere.agreement, 0.9);
  EXPECT_GT(elsewhere.contradictions, 20);
  EXPECT_GT(elsewhere.loss, 2.0 * there.loss);
}

}  // namespace
}  // namespace sckf::test
