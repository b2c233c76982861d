// How near the matcher comes to what the ranges can tell at best: the Cramér-Rao bound of a displacement in rooms.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <iostream>
#include <random>
#include <vector>

#include "matching/simulated_world.h"
#include "sckf_odometry/matching/scan_matcher.h"

namespace sckf::test {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// Which wall a ray meets first.
std::size_t wallAhead(const World& world, const Vector2d& origin, const Vector2d& direction) {
  std::size_t nearest = 0;
  for (std::size_t w = 1; w < world.size(); ++w) {
    if (castRay({world[w]}, origin, direction) < castRay({world[nearest]}, origin, direction)) nearest = w;
  }
  return nearest;
}

/// What two scans tell of the displacement between them: Fisher's information of its additive error. Nobody knows the
/// walls, of which each has an angle and an offset; that they are straight, and which beam meets which, is known. Beams
/// that meet a wall at less than 6° are left out: the range of such a one changes by ten metres per radian and more, as
/// no laser tells.
Matrix3d information(const World& world, const SE2& displacement, const SimulatedLaser& laser) {
  constexpr double kGrazing = 0.1;
  const auto unknowns = static_cast<Eigen::Index>(3 + 2 * world.size());
  MatrixXd all = MatrixXd::Zero(unknowns, unknowns);
  for (const bool is_current : {false, true}) {
    const SE2 pose = is_current ? displacement : SE2();
    for (int i = 0; i < laser.beams; ++i) {
      const Vector2d u = SE2(0.0, 0.0, pose.yaw + laser.angle_min + i * laser.angle_increment).rotation().col(0);
      const std::size_t w = wallAhead(world, pose.translation(), u);
      const Vector2d n = quarterTurn((world[w].to - world[w].from).normalized());
      const double across = n.dot(u);
      if (std::abs(across) < kGrazing) continue;
      const double distance = n.dot(world[w].from - pose.translation());  // the range is distance / across
      const double by_turn = distance / (across * across);
      Eigen::RowVectorXd J = Eigen::RowVectorXd::Zero(unknowns);
      if (is_current) J.head<3>() << -n.transpose() / across, -by_turn * n.dot(quarterTurn(u));
      J.segment<2>(static_cast<Eigen::Index>(3 + 2 * w)) << 1.0 / across,
          -quarterTurn(n).dot(pose.translation()) / across - by_turn * quarterTurn(n).dot(u);
      all += J.transpose() * J / (laser.noise * laser.noise);
    }
  }
  const Eigen::Index walls = unknowns - 3;
  const MatrixXd shared = all.topRightCorner(3, walls);
  const MatrixXd of_walls = all.bottomRightCorner(walls, walls);
  return all.topLeftCorner<3, 3>() - shared * of_walls.completeOrthogonalDecomposition().solve(shared.transpose());
}

//   +---^---+
//   <   +   >   Four beams, each square to its wall: along x each scan has two ranges of which one wall is the sum,
//   +---v---+   and turning changes none of them.
TEST(CramerRaoBoundByHand, OfFourBeams) {
  SimulatedLaser laser;
  laser.beams = 4;
  laser.angle_increment = M_PI_2;
  laser.noise = 0.01;
  const Matrix3d seen = information(closedPolygon({{-2, -2}, {2, -2}, {2, 2}, {-2, 2}}), SE2(), laser);
  EXPECT_NEAR(seen(0, 0) * 1e-4, 1.0, 1e-9);
  EXPECT_NEAR(seen(1, 1) * 1e-4, 1.0, 1e-9);
  EXPECT_NEAR(seen(2, 2) * 1e-4, 0.0, 1e-9);
}

struct Room {
  const char* name;
  World world;
};

std::ostream& operator<<(std::ostream& out, const Room& room) { return out << room.name; }

World withPillar() {
  World world = closedPolygon({{-3, -2}, {4, -2}, {4, 3}, {-3, 3}});
  const World pillar = closedPolygon({{1.5, 1.2}, {2.3, 1.2}, {2.3, 2.0}, {1.5, 2.0}});
  world.insert(world.end(), pillar.begin(), pillar.end());
  return world;
}

class CramerRaoBound : public ::testing::TestWithParam<Room> {};

TEST_P(CramerRaoBound, IsNearlyReached) {
  constexpr int kRuns = 500;
  constexpr double kAtMost = 1.20;  // its std is 3 % with so many runs
  const World& world = GetParam().world;
  SimulatedLaser laser;
  laser.noise = 0.02;
  for (const SE2& truth : {SE2(0.2, 0.05, 0.1), SE2(0.4, -0.1, 0.3)}) {
    const DisplacementPrediction prediction{corrected(truth, Vector3d(0.02, -0.02, 0.01)),
                                            0.05 * 0.05 * Matrix3d::Identity()};
    std::mt19937_64 random(7);
    const auto scanAt = [&](const SE2& pose) {
      return prepareScan(simulateScan(world, pose, laser, &random), laser.base_from_laser, ScanOptions());
    };
    Vector3d squared = Vector3d::Zero();
    for (int run = 0; run < kRuns; ++run) {
      const auto reference = scanAt(SE2());
      const auto current = scanAt(truth);
      const Match match = ScanMatcher(MatcherOptions()).match(*reference, *current, prediction);
      ASSERT_TRUE(match.displacement) << toString(match.failure);
      squared += error(match.displacement->reference_from_current, truth).cwiseAbs2() / kRuns;
    }
    const Vector3d bound = information(world, truth, laser).inverse().diagonal().cwiseSqrt();
    const Vector3d ratio = squared.cwiseSqrt().cwiseQuotient(bound);
    EXPECT_LT(ratio.maxCoeff(), kAtMost) << "x, y, yaw: " << ratio.transpose() << ", bound " << bound.transpose();
    EXPECT_GT(ratio.minCoeff(), 0.9) << "better than can be: " << ratio.transpose();
    std::cout << GetParam() << ", rms error over the bound in x, y, yaw: " << ratio.transpose() << "\n";
  }
}

INSTANTIATE_TEST_SUITE_P(Rooms, CramerRaoBound,
                         ::testing::Values(Room{"rectangular", closedPolygon({{-3, -2}, {4, -2}, {4, 3}, {-3, 3}})},
                                           Room{"with a pillar", withPillar()},
                                           Room{"L-shaped",
                                                closedPolygon({{-3, -2}, {5, -2}, {5, 1}, {2, 1}, {2, 4}, {-3, 4}})},
                                           Room{"with a pillar and a niche", room()}));

}  // namespace
}  // namespace sckf::test
