// How pairs of points are weighed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "matching/simulated_world.h"
#include "sckf_odometry/matching/alignment_problem.h"

namespace sckf::test {
namespace {

std::shared_ptr<const PreparedScan> scanOf(const World& world) {
  SimulatedLaser laser;
  laser.noise = 0.0;
  return prepareScan(simulateScan(world, SE2(), laser, nullptr), laser.base_from_laser, {});
}

/// A square room whose wall ahead is turned about its middle [rad].
World roomWithWallTurned(double by) {
  const double d = 3.0 * std::tan(by);
  return closedPolygon({{-3.0, -3.0}, {3.0 + d, -3.0}, {3.0 - d, 3.0}, {-3.0, 3.0}});
}

TEST(AlignmentProblem, SurfacesThatAreTurnedAgainstEachOtherByMoreThanMostWeighLess) {
  const auto reference = scanOf(roomWithWallTurned(0.0));
  const auto current = scanOf(roomWithWallTurned(0.05));
  PairOptions agreeing;
  agreeing.normal_agreement = 0.1;
  PairOptions any;
  any.normal_agreement = 1e9;
  for (const double yaw : {0.0, 0.02}) {  // which turns all surfaces
    const AlignmentProblem problem(*reference, *current, SE2(0.0, 0.0, yaw), 0.3, agreeing);
    const AlignmentProblem plain(*reference, *current, SE2(0.0, 0.0, yaw), 0.3, any);
    ASSERT_EQ(problem.residuals().size(), plain.residuals().size());
    int turned = 0;
    int others = 0;
    for (std::size_t i = 0; i < problem.residuals().size(); ++i) {
      const Residual& residual = problem.residuals()[i];
      const double ratio = plain.residuals()[i].precision / residual.precision;
      if (residual.surface == nullptr || residual.surface->centroid.cwiseAbs().minCoeff() > 1.5) continue;
      const bool ahead = residual.surface->centroid.x() > 2.5;
      EXPECT_NEAR(ratio, ahead ? std::hypot(1.0, 0.05 / 0.1) : 1.0, 0.01) << residual.surface->centroid.transpose();
      ++(ahead ? turned : others);
    }
    EXPECT_GT(turned, 20);
    EXPECT_GT(others, 60);
  }
}

TEST(AlignmentProblem, AScanOfOnePointIsComparedWithAsAny) {
  const auto room = scanOf(roomWithWallTurned(0.0));
  std::vector<bool> all_but_one(room->size(), true);
  all_but_one.front() = false;
  const auto one = setAside(*room, all_but_one, {});
  const AlignmentProblem problem(*one, *one, SE2(), 0.3, {});
  ASSERT_EQ(problem.pairs().size(), 1U);
  EXPECT_TRUE(problem.normalEquations(SE2()).information.allFinite());
}

// ---- what contradicts

/// A square room, with a board of 1 m across the way ahead if asked for.
World roomWithBoard(bool board) {
  World world = closedPolygon({{-3.0, -3.0}, {3.0, -3.0}, {3.0, 3.0}, {-3.0, 3.0}});
  if (board) world.push_back({{1.5, -0.5}, {1.5, 0.5}});
  return world;
}

int pointsOnBoard(const PreparedScan& scan) {
  return static_cast<int>(std::count_if(scan.points.point.begin(), scan.points.point.end(), [](const auto& p) {
    return std::abs(p.x() - 1.5) < 0.01 && std::abs(p.y()) < 0.51;
  }));
}

TEST(AlignmentProblem, WhatStandsWhereTheOtherScanLookedThroughContradicts) {
  const auto without = scanOf(roomWithBoard(false));
  const auto with = scanOf(roomWithBoard(true));
  const int board = pointsOnBoard(*with);
  ASSERT_GT(board, 30);
  const AlignmentProblem came(*without, *with, SE2(), 0.2, PairOptions());
  const AlignmentProblem left(*with, *without, SE2(), 0.2, PairOptions());
  for (const AlignmentProblem* problem : {&came, &left}) {
    EXPECT_NEAR(problem->contradictions(), board, 2);
    const auto pairs = static_cast<double>(problem->pairs().size());
    EXPECT_NEAR(problem->agreement(), pairs / (pairs + board), 0.01);
  }
}

std::shared_ptr<const PreparedScan> roomWithBoardFrom(const SE2& pose) {
  const SimulatedLaser front = frontLaser();
  return prepareScan(simulateScan(roomWithBoard(true), pose, front), front.base_from_laser, {});
}

TEST(AlignmentProblem, WhatTheOtherScanCannotSeeDoesNotContradict) {
  const auto reference = roomWithBoardFrom(SE2());
  for (const SE2& place : {SE2(-1.5, 0.0, 0.0), SE2(-0.5, 1.0, 0.9), SE2(0.5, -1.5, -0.7)}) {  // back, and turned
    const auto current = roomWithBoardFrom(place);
    const AlignmentProblem problem(*reference, *current, place, 0.2, PairOptions());
    EXPECT_LT(problem.overlap(), 0.8) << place.vector().transpose();
    EXPECT_GT(problem.agreement(), 0.98) << place.vector().transpose();
  }
}

TEST(AlignmentProblem, WhatTheOtherScanCannotSeeCostsNoMoreThanWhatItSees) {
  const SE2 back(-1.0, 0.0, 0.0);
  const auto reference = roomWithBoardFrom(SE2());
  const auto current = roomWithBoardFrom(back);
  const auto misfitAt = [&](const SE2& x) {
    return AlignmentProblem(*reference, *current, x, 0.2, PairOptions()).misfit(x);
  };
  EXPECT_LT(misfitAt(back), 0.1);
  EXPECT_GT(misfitAt(SE2()), 0.5) << "where more of the points have a partner, and more contradict";
  EXPECT_GT(misfitAt(SE2(0.0, 0.0, M_PI)), 1.0) << "where there is nothing to compare";
}

TEST(AlignmentProblem, PointsThatTheReferenceHasLookedThroughAllAreOfTheLargestMisfit) {
  const auto large = scanOf(closedPolygon({{-3.0, -3.0}, {3.0, -3.0}, {3.0, 3.0}, {-3.0, 3.0}}));
  const auto small = scanOf(closedPolygon({{-1.0, -1.0}, {1.0, -1.0}, {1.0, 1.0}, {-1.0, 1.0}}));
  const AlignmentProblem problem(*large, *small, SE2(), 0.2, PairOptions());
  EXPECT_DOUBLE_EQ(problem.misfit(SE2()), 3.0);
}

/// Noise along the beams shows less across a wall the smaller the angle that it is seen at, its roughness always.
TEST(AlignmentProblem, NormalsAreAsNoisyAsTheirPointsAcrossThem) {
  const auto scan = scanOf(closedPolygon({{-3.0, -3.0}, {3.0, -3.0}, {3.0, 3.0}, {-3.0, 3.0}}));
  const AlignmentProblem problem(*scan, *scan, SE2(), 0.3, PairOptions());
  int compared = 0;
  for (const Residual& residual : problem.residuals()) {
    const Eigen::Vector2d& p = scan->points.point[static_cast<std::size_t>(residual.reference)];
    if (residual.surface == nullptr || p.cwiseAbs().minCoeff() > 2.0) continue;
    const double across = scan->range_noise * p.cwiseAbs().maxCoeff() / p.norm();
    const double expected = (across * across + kWallRoughness * kWallRoughness) / residual.surface->spread;
    EXPECT_NEAR(residual.normal_variance, expected, 1e-3 * expected) << p.transpose();
    ++compared;
  }
  EXPECT_GT(compared, 100);
}

}  // namespace
}  // namespace sckf::test
