// Landmarks in the state: hand values, what they must never learn, and whether the covariance can be believed.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/landmark_robot.h"
#include "core/matrix_matchers.h"
#include "core/random_inputs.h"
#include "sckf_odometry/core/multi_clone_filter.h"

namespace sckf {
namespace {

using Eigen::Matrix3d;

Matrix3d diagonal(double x, double y, double yaw) { return Eigen::Vector3d(x, y, yaw).cwiseAbs2().asDiagonal(); }

// The robot looks along y and sees a landmark 2 m ahead, turned to the left.
//
//        L ⟵         y
//                     |
//        ↑ robot      +-- x
//
TEST(LandmarkStates, ALandmarkIsWhereItIsSeen) {
  MultiCloneFilter filter(SE2(10.0, 5.0, M_PI_2), diagonal(0.0, 0.0, 0.0));
  filter.addLandmark({SE2(2.0, 0.0, M_PI_2), diagonal(0.1, 0.2, 0.3)});
  ASSERT_EQ(filter.landmarks(), 1U);
  EXPECT_LT(error(filter.landmark(0), SE2(10.0, 7.0, M_PI)).norm(), 1e-12);
  // Ahead of the robot is along y.
  EXPECT_TRUE(matricesNear(filter.landmarkCovariance(0), diagonal(0.2, 0.1, 0.3), 1e-12));
}

TEST(LandmarkStates, AYawThatIsNotKnownIsALeverToTheLandmark) {
  MultiCloneFilter filter(SE2(10.0, 5.0, 0.0), diagonal(0.1, 0.1, 0.2));
  filter.addLandmark({SE2(3.0, 0.0, 0.0), Matrix3d::Zero()});
  const Matrix3d P = filter.landmarkCovariance(0);
  EXPECT_NEAR(P(0, 0), 0.01, 1e-12);
  EXPECT_NEAR(P(1, 1), 0.01 + 9.0 * 0.04, 1e-12);
  EXPECT_NEAR(P(1, 2), 3.0 * 0.04, 1e-12);
}

/// From where it was begun a landmark is known as well as it was seen; seen a second time it is as good as two.
TEST(LandmarkStates, TheInnovationIsOfBothSightings) {
  MultiCloneFilter filter(SE2(3.0, 1.0, 0.4), diagonal(1.0, 1.0, 0.5));
  const Sighting seen{SE2(2.0, 1.0, 0.3), diagonal(0.1, 0.2, 0.05)};
  filter.addLandmark(seen);
  const Sighting again{corrected(seen.base_from_landmark, Eigen::Vector3d(0.1, 0.0, 0.0)), seen.covariance};
  const Innovation r = filter.innovation(0, again);
  EXPECT_TRUE(matricesNear(r.residual, Eigen::Vector3d(0.1, 0.0, 0.0), 1e-12));
  EXPECT_TRUE(matricesNear(r.covariance, 2.0 * seen.covariance, 1e-12));
  EXPECT_NEAR(r.nis(), 0.5, 1e-9);
  filter.update(0, again);
  const SE2 expected = between(filter.pose(), filter.landmark(0));
  EXPECT_NEAR(expected.x, 2.05, 1e-3) << "halfway";
  EXPECT_TRUE(matricesNear(filter.innovation(0, again).covariance, 1.5 * seen.covariance, 1e-3));
}

TEST(LandmarkStates, ThoseAfterAForgottenOneMoveUp) {
  MultiCloneFilter filter(SE2(), diagonal(0.1, 0.1, 0.1));
  for (const double x : {1.0, 2.0, 3.0}) filter.addLandmark({SE2(x, 0.0, 0.0), diagonal(0.1, 0.1, 0.1)});
  filter.forgetLandmark(1);
  ASSERT_EQ(filter.landmarks(), 2U);
  EXPECT_NEAR(filter.landmark(0).x, 1.0, 1e-12);
  EXPECT_NEAR(filter.landmark(1).x, 3.0, 1e-12);
  // The place of the forgotten one is as good as new.
  filter.addLandmark({SE2(4.0, 0.0, 0.0), Matrix3d::Zero()});
  EXPECT_NEAR(filter.landmarkCovariance(2)(0, 0), 0.01, 1e-12);
}

TEST(LandmarkStates, NobodyLearnsWhereTheWholeIs) {
  // As MultiCloneFilter.NeverLearnsWhereTheWholeIs: estimates move with each noisy update, and none is a compass.
  RandomInputs random(183);
  MultiCloneFilter filter(SE2(), Eigen::Vector3d(1.0, 1.0, 0.09).asDiagonal());
  const Eigen::VectorXd R = Eigen::VectorXd::Constant(4, 1e-3);
  for (int scan = 0; scan < 500; ++scan) {
    filter.propagate({SE2(0.3, 0.02, 0.05), random.covariance(3, 0.1)});
    if (scan > 0) {
      const Displacement z = random.displacement(filter.predictedDisplacement().reference_from_current, 3, R, R, 0.02);
      filter.update(z, filter.innovation(z));
    }
    for (std::size_t i = 0; i < filter.landmarks(); ++i) {
      const SE2 expected = between(filter.pose(), filter.landmark(i));
      const Eigen::Vector3d off(0.05 * random.gaussian(3));
      filter.update(i, {corrected(expected, off), random.covariance(3, 0.05)});
    }
    if (scan % 10 == 0) filter.addLandmark({random.pose(5.0), random.covariance(3, 0.05)});
    if (filter.landmarks() > 5) filter.forgetLandmark(0);
    filter.clone(R);
    if (filter.clones() > 3) filter.forget(3);
    ASSERT_GE(filter.covariance()(2, 2), 0.09 * (1.0 - 1e-6)) << "yaw variance at scan " << scan;
  }
}

TEST(LandmarkStates, AnotherWorldLeavesThemWhereTheRobotSeesThem) {
  MultiCloneFilter filter(SE2(1.0, 2.0, 0.3), diagonal(0.1, 0.1, 0.1));
  const Sighting seen{SE2(2.0, 1.0, 0.3), diagonal(0.1, 0.2, 0.05)};
  filter.addLandmark(seen);
  const Matrix3d before = filter.innovation(0, seen).covariance;
  filter.enterWorld({SE2(400.0, -300.0, 2.5), diagonal(0.01, 0.01, 0.01)});
  EXPECT_NEAR(filter.pose().x, 400.0, 1e-3);
  EXPECT_LT(error(between(filter.pose(), filter.landmark(0)), seen.base_from_landmark).norm(), 1e-6);
  EXPECT_TRUE(matricesNear(filter.innovation(0, seen).covariance, before, 1e-6));
}

// ---- consistency

TEST(LandmarkStates, ConsistentAloneAndBesideDisplacementsWhichTogetherAreTheBest) {
  LandmarkWorld world{};
  world.places = [](RandomInputs& random) {
    std::vector<SE2> places;
    for (double x = -8.0; x < 9.0; x += 2.0) {
      places.push_back({x, 2.5, random.uniform(-3.0, 3.0)});
      places.push_back({x + 1.0, -2.5, random.uniform(-3.0, 3.0)});
    }
    return places;
  };
  world.exact = [](const SE2& base_from_landmark) { return Sighting{base_from_landmark, Matrix3d::Zero()}; };
  world.seen = [](const SE2& robot, const SE2& landmark, RandomInputs& random) {
    const Matrix3d R = random.covariance(3, 0.02);
    return Sighting{corrected(between(robot, landmark), random.drawnFrom(R)), R};
  };
  world.degrees_of_freedom = 3;
  world.most = 6;
  world.seed = 3000;
  expectConsistentAndBestTogether(world);
}

}  // namespace
}  // namespace sckf
