// How pairs of points are weighed.
#include <gtest/gtest.h>

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
      const double ratio = residual.std / plain.residuals()[i].std;
      if (residual.surface == nullptr || residual.surface->centroid.cwiseAbs().minCoeff() > 1.5) continue;
      const bool ahead = residual.surface->centroid.x() > 2.5;
      EXPECT_NEAR(ratio, ahead ? std::hypot(1.0, 0.05 / 0.1) : 1.0, 0.01) << residual.surface->centroid.transpose();
      ++(ahead ? turned : others);
    }
    EXPECT_GT(turned, 20);
    EXPECT_GT(others, 60);
  }
}

}  // namespace
}  // namespace sckf::test
