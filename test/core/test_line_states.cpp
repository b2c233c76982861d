// Straight walls in the state, of which no sighting tells where along them it is: hand values, numerical derivatives,
// what they must never learn, and whether the covariance can be believed.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/landmark_robot.h"
#include "core/matrix_matchers.h"
#include "core/random_inputs.h"
#include "sckf_odometry/core/multi_clone_filter.h"

namespace sckf {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// A line that is seen so certainly in offset and yaw.
Sighting sighting(const SE2& base_from_line, const Matrix2d& across_and_yaw) {
  Sighting line{base_from_line, Matrix3d::Zero(), true};
  line.covariance = line.seen().transpose() * across_and_yaw * line.seen();
  return line;
}

Matrix2d diagonal(double across, double yaw) { return Vector2d(across, yaw).cwiseAbs2().asDiagonal(); }

// The robot looks along x, and sees a wall 2 m to its left, which runs along x too.
//
//      ————————→ L
//      robot →           y
//                        +-- x
//
TEST(LineStates, WhereAlongItTheFrameIsIsNothingThatIsMeasured) {
  MultiCloneFilter filter(SE2(), Matrix3d::Zero());
  filter.addLandmark(sighting(SE2(1.0, 2.0, 0.0), diagonal(0.1, 0.05)));
  EXPECT_TRUE(matricesNear(filter.landmarkCovariance(0), Matrix3d(Vector3d(0.0, 0.01, 0.0025).asDiagonal()), 1e-12));
  const Innovation r = filter.innovation(0, sighting(SE2(7.0, 2.1, 0.0), diagonal(0.0, 0.0)));
  EXPECT_TRUE(matricesNear(r.residual, Vector2d(0.1, 0.0), 1e-12));
  // Six metres further on its yaw is a lever.
  Matrix2d expected;
  expected << 0.01 + 36.0 * 0.0025, 6.0 * 0.0025, 6.0 * 0.0025, 0.0025;
  EXPECT_TRUE(matricesNear(r.covariance, expected, 1e-12));
}

TEST(LineStates, TheInnovationIsOfBothSightings) {
  MultiCloneFilter filter(SE2(3.0, 1.0, 0.4), Vector3d(1.0, 1.0, 0.5).asDiagonal());
  const Sighting seen = sighting(SE2(2.0, 1.0, 0.3), diagonal(0.2, 0.05));
  filter.addLandmark(seen);
  const Vector2d normal(-std::sin(0.3), std::cos(0.3));
  const SE2 off(2.0 + 0.1 * normal.x(), 1.0 + 0.1 * normal.y(), 0.3);
  const Sighting again = sighting(off, diagonal(0.2, 0.05));
  const Innovation r = filter.innovation(0, again);
  EXPECT_TRUE(matricesNear(r.residual, Vector2d(0.1, 0.0), 1e-12));
  EXPECT_TRUE(matricesNear(r.covariance, 2.0 * diagonal(0.2, 0.05), 1e-12));
  EXPECT_NEAR(r.nis(), 0.125, 1e-9);
  filter.update(0, again);
  const SE2 expected = between(filter.pose(), filter.landmark(0));
  EXPECT_NEAR(normal.dot(expected.translation() - Vector2d(2.0, 1.0)), 0.05, 1e-3) << "halfway";
  EXPECT_TRUE(matricesNear(filter.innovation(0, again).covariance, 1.5 * diagonal(0.2, 0.05), 1e-3));
}

/// Offset and yaw by which a line is sighted beside another, both as a robot sees them, in plain geometry.
Vector2d offBy(const SE2& sighted, const SE2& expected) {
  const Vector2d along(std::cos(expected.yaw), std::sin(expected.yaw));
  const Vector2d d = sighted.translation() - expected.translation();
  return {along.x() * d.y() - along.y() * d.x(), wrapAngle(sighted.yaw - expected.yaw)};
}

TEST(LineStates, TheInnovationsCovarianceByNumericalDerivatives) {
  RandomInputs random(41);
  for (int i = 0; i < 30; ++i) {
    const SE2 start = random.pose(5.0);
    const SE2 motion = random.pose(2.0);
    const SE2 first = random.pose(4.0);
    const SE2 world_from_line = compose(start, first);
    const SE2 again = compose(between(compose(start, motion), world_from_line), SE2(random.uniform(-3.0, 3.0), 0, 0));
    const Matrix3d Q = random.covariance(3, 0.1);
    const Matrix2d R = random.covariance(2, 0.1);

    MultiCloneFilter filter(start, random.covariance(3, 0.3));
    const Sighting sighted = sighting(first, R);
    filter.addLandmark(sighted);
    filter.propagate({motion, Q});
    const Innovation r = filter.innovation(0, sighting(again, Matrix2d::Zero()));
    EXPECT_LT(r.residual.norm(), 1e-9);

    // By the error of the motion, and by that of the first sighting.
    constexpr double kStep = 1e-6;
    const auto expected = [&](const Vector3d& of_motion, const Vector3d& of_sighting) {
      const SE2 line = compose(start, corrected(first, of_sighting));
      return between(compose(start, corrected(motion, of_motion)), line);
    };
    Eigen::Matrix<double, 2, 3> by_motion;
    Eigen::Matrix<double, 2, 3> by_sighting;
    for (int j = 0; j < 3; ++j) {
      const Vector3d e = kStep * Vector3d::Unit(j);
      const Vector3d none = Vector3d::Zero();
      by_motion.col(j) = (offBy(again, expected(e, none)) - offBy(again, expected(-e, none))) / (2.0 * kStep);
      by_sighting.col(j) = (offBy(again, expected(none, e)) - offBy(again, expected(none, -e))) / (2.0 * kStep);
    }
    const Matrix2d numerical =
        by_motion * Q * by_motion.transpose() + by_sighting * sighted.covariance * by_sighting.transpose();
    EXPECT_TRUE(matricesNear(r.covariance, numerical, 1e-6));
  }
}

TEST(LineStates, AlongACorridorNobodyLearnsWhereTheRobotIs) {
  // Noise moves the walls' estimates about, and with each the direction that they leave open: it must not close.
  RandomInputs random(7);
  const Matrix3d Q = Vector3d(0.02, 0.02, 0.02).cwiseAbs2().asDiagonal();
  MultiCloneFilter filter(SE2(), Matrix3d::Zero());
  SE2 truth;
  double by_wheels = 0.0;  // [m²]
  for (int scan = 0; scan < 400; ++scan) {
    const SE2 motion(0.1, 0.0, -0.2 * truth.yaw - 0.02 * truth.y);
    filter.propagate({motion, Q});
    truth = compose(truth, corrected(motion, random.drawnFrom(Q)));
    by_wheels += Q(0, 0);
    for (const double side : {1.5, -1.5}) {
      const SE2 wall(truth.x + random.uniform(-2.0, 2.0), side, 0.0);
      const Matrix2d R = diagonal(0.01, 0.01);
      const SE2 seen =
          between(truth, compose(wall, SE2(0.0, 0.01 * random.gaussian(1)(0), 0.01 * random.gaussian(1)(0))));
      const std::size_t number = side > 0.0 ? 0 : 1;
      if (filter.landmarks() <= number) {
        filter.addLandmark(sighting(seen, R));
      } else {
        filter.update(number, sighting(seen, R));
      }
    }
    ASSERT_GT(filter.covariance()(0, 0), 0.98 * by_wheels) << "at scan " << scan;
  }
  const SE2 beside(0.0, between(filter.pose(), filter.landmark(0)).y, 0.0);
  EXPECT_LT(std::sqrt(filter.innovation(0, sighting(beside, diagonal(0.0, 0.0))).covariance(0, 0)), 0.01);
}

TEST(LineStates, NobodyLearnsWhereTheWholeIs) {
  RandomInputs random(184);
  MultiCloneFilter filter(SE2(), Vector3d(1.0, 1.0, 0.09).asDiagonal());
  for (int scan = 0; scan < 500; ++scan) {
    filter.propagate({SE2(0.3, 0.02, 0.05), random.covariance(3, 0.1)});
    for (std::size_t i = 0; i < filter.landmarks(); ++i) {
      const SE2 expected = between(filter.pose(), filter.landmark(i));
      const SE2 off(0.5 * random.gaussian(1)(0), 0.05 * random.gaussian(1)(0), 0.05 * random.gaussian(1)(0));
      filter.update(i, sighting(compose(expected, off), random.covariance(2, 0.05)));
    }
    if (scan % 10 == 0) filter.addLandmark(sighting(random.pose(5.0), random.covariance(2, 0.05)));
    if (filter.landmarks() > 5) filter.forgetLandmark(0);
    ASSERT_GE(filter.covariance()(2, 2), 0.09 * (1.0 - 1e-6)) << "yaw variance at scan " << scan;
  }
}

// ---- consistency

/// Pieces of wall, turned anyhow, of which each time another stretch is seen.
TEST(LineStates, ConsistentAloneAndBesideDisplacementsWhichTogetherAreTheBest) {
  LandmarkWorld world{};
  world.places = [](RandomInputs& random) {
    std::vector<SE2> places;
    for (double x = -8.0; x < 9.0; x += 1.0) places.push_back({x, 2.5, random.uniform(-M_PI, M_PI)});
    return places;
  };
  world.exact = [](const SE2& base_from_line) { return sighting(base_from_line, Matrix2d::Zero()); };
  world.seen = [](const SE2& robot, const SE2& wall, RandomInputs& random) {
    const SE2 truth = between(robot, compose(wall, SE2(random.uniform(-0.8, 0.8), 0.0, 0.0)));
    const Matrix2d R = random.covariance(2, 0.02);
    const Vector2d off = random.drawnFrom(R);
    return sighting(compose(truth, SE2(0.0, off(0), off(1))), R);
  };
  world.degrees_of_freedom = 2;
  world.most = 8;
  world.seed = 5000;
  expectConsistentAndBestTogether(world);
}

}  // namespace
}  // namespace sckf
