#include <gtest/gtest.h>

#include <cmath>

#include "core/matrix_matchers.h"
#include "core/random_inputs.h"
#include "sckf_odometry/core/se2.h"

namespace sckf {
namespace {

constexpr double kDegree = M_PI / 180.0;
constexpr int kPoses = 200;

::testing::AssertionResult posesNear(const SE2& a, const SE2& b, double tolerance) {
  if (error(a, b).cwiseAbs().maxCoeff() <= tolerance) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << "left [" << a.vector().transpose() << "], right [" << b.vector().transpose()
                                       << "]";
}

TEST(WrapAngle, LeavesWhatIsInRange) {
  for (const double angle : {0.0, 1.0, -1.0, 3.14, -3.14, M_PI}) EXPECT_DOUBLE_EQ(wrapAngle(angle), angle);
}

TEST(WrapAngle, TakesMinusPiToPi) {
  EXPECT_DOUBLE_EQ(wrapAngle(-M_PI), M_PI);
  EXPECT_DOUBLE_EQ(wrapAngle(std::nextafter(-M_PI, 0.0)), -M_PI) << "the next angle above -pi is in range";
  EXPECT_DOUBLE_EQ(wrapAngle(std::nextafter(M_PI, 4.0)), -M_PI) << "the next angle above pi comes round";
}

TEST(WrapAngle, TakesOffWholeTurns) {
  EXPECT_NEAR(wrapAngle(190.0 * kDegree), -170.0 * kDegree, 1e-14);
  EXPECT_NEAR(wrapAngle(-190.0 * kDegree), 170.0 * kDegree, 1e-14);
  EXPECT_NEAR(wrapAngle(2.0 * M_PI), 0.0, 1e-14);
  EXPECT_NEAR(wrapAngle(725.0 * kDegree), 5.0 * kDegree, 1e-13);
  EXPECT_NEAR(wrapAngle(-1e5 * 2.0 * M_PI + 0.5), 0.5, 1e-9);
}

TEST(WrapAngle, KeepsHugeAnglesInRange) {
  RandomInputs random(1);
  for (int i = 0; i < 10000; ++i) {
    const double angle = (random.integer(0, 1) == 0 ? 1.0 : -1.0) * random.magnitude(1e-3, 1e18);
    const double wrapped = wrapAngle(angle);
    ASSERT_GT(wrapped, -M_PI) << angle;
    ASSERT_LE(wrapped, M_PI) << angle;
    if (std::abs(angle) < 1e6) {
      // 2π as a double is off by 2.4e-16: after 1e6 / 2π turns the direction is off by 4e-11.
      ASSERT_NEAR(std::cos(wrapped), std::cos(angle), 1e-10) << angle;
      ASSERT_NEAR(std::sin(wrapped), std::sin(angle), 1e-10) << angle;
    }
  }
}

TEST(SE2, WrapsItsYaw) {
  EXPECT_NEAR(SE2(1.0, 2.0, 3.5 * M_PI).yaw, -0.5 * M_PI, 1e-14);
  EXPECT_NEAR(SE2(Eigen::Vector3d(1.0, 2.0, -1.5 * M_PI)).yaw, 0.5 * M_PI, 1e-14);
}

//      y
//    4 +   b' at (0, 4), looking 60° up
//      |   ┐
//      |   │ 1 to the left
//      |   └──────┐
//    2 +          a at (1, 2), looking along y; b is 2 ahead of it and 1 to its left, turned by −30°
//      |
//      +---+------+---> x
//          0      1
TEST(SE2, ComposesByHand) {
  const SE2 a(1.0, 2.0, 90.0 * kDegree);
  const SE2 b(2.0, 1.0, -30.0 * kDegree);
  Eigen::Matrix3d J_out_a;
  Eigen::Matrix3d J_out_b;
  EXPECT_TRUE(posesNear(compose(a, b, &J_out_a, &J_out_b), SE2(0.0, 4.0, 60.0 * kDegree), 1e-15));
  EXPECT_TRUE(posesNear(between(a, SE2(0.0, 4.0, 60.0 * kDegree)), b, 1e-15));

  Eigen::Matrix3d by_a;  // turning a turns the lever (−1, 2) from a to b' by a quarter: (−2, −1)
  by_a << 1.0, 0.0, -2.0, 0.0, 1.0, -1.0, 0.0, 0.0, 1.0;
  Eigen::Matrix3d by_b;  // b moves along a's axes
  by_b << 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0;
  EXPECT_TRUE(matricesNear(J_out_a, by_a, 1e-15));
  EXPECT_TRUE(matricesNear(J_out_b, by_b, 1e-15));
}

TEST(SE2, InvertsByHand) {
  // From a, the origin is 2 behind and 1 to the left.
  EXPECT_TRUE(posesNear(inverse(SE2(1.0, 2.0, 90.0 * kDegree)), SE2(-2.0, 1.0, -90.0 * kDegree), 1e-15));
}

TEST(SE2, TakesPointsToTheOtherFrame) {
  const SE2 a_from_b(1.0, 2.0, 90.0 * kDegree);
  EXPECT_TRUE(matricesNear(a_from_b * Eigen::Vector2d(2.0, 1.0), Eigen::Vector2d(0.0, 4.0), 1e-15));
}

TEST(SE2, IsAGroup) {
  RandomInputs random(2);
  for (int i = 0; i < kPoses; ++i) {
    const SE2 a = random.pose(10.0);
    const SE2 b = random.pose(10.0);
    const SE2 c = random.pose(10.0);
    ASSERT_TRUE(posesNear(compose(a, compose(b, c)), compose(compose(a, b), c), 1e-13));
    ASSERT_TRUE(posesNear(compose(a, SE2()), a, 0.0));
    ASSERT_TRUE(posesNear(compose(SE2(), a), a, 0.0));
    ASSERT_TRUE(posesNear(compose(a, inverse(a)), SE2(), 1e-13));
    ASSERT_TRUE(posesNear(compose(inverse(a), a), SE2(), 1e-13));
    ASSERT_TRUE(posesNear(inverse(compose(a, b)), compose(inverse(b), inverse(a)), 1e-13));
    ASSERT_TRUE(posesNear(between(a, b), compose(inverse(a), b), 1e-13));
    ASSERT_TRUE(posesNear(compose(a, between(a, b)), b, 1e-13));
  }
}

TEST(SE2, ActsOnPointsAsItComposes) {
  RandomInputs random(3);
  for (int i = 0; i < kPoses; ++i) {
    const SE2 a = random.pose(10.0);
    const SE2 b = random.pose(10.0);
    const Eigen::Vector2d p = random.gaussian(2);
    ASSERT_TRUE(matricesNear(compose(a, b) * p, a * (b * p), 1e-13));
    ASSERT_TRUE(matricesNear(a.rotation() * a.rotation().transpose(), Eigen::Matrix2d::Identity(), 1e-15));
  }
}

TEST(SE2, ComposeJacobiansAreTheNumericalOnes) {
  RandomInputs random(4);
  for (int i = 0; i < kPoses; ++i) {
    const SE2 a = random.pose(10.0);
    const SE2 b = random.pose(10.0);
    Eigen::Matrix3d J_out_a;
    Eigen::Matrix3d J_out_b;
    compose(a, b, &J_out_a, &J_out_b);
    ASSERT_TRUE(matricesNear(J_out_a, numericalJacobian([&](const SE2& x) { return compose(x, b); }, a), 1e-8));
    ASSERT_TRUE(matricesNear(J_out_b, numericalJacobian([&](const SE2& x) { return compose(a, x); }, b), 1e-8));
  }
}

TEST(SE2, InverseJacobianIsTheNumericalOne) {
  RandomInputs random(5);
  for (int i = 0; i < kPoses; ++i) {
    const SE2 a = random.pose(10.0);
    Eigen::Matrix3d J_out_a;
    inverse(a, &J_out_a);
    ASSERT_TRUE(matricesNear(J_out_a, numericalJacobian([](const SE2& x) { return inverse(x); }, a), 1e-8));
  }
}

TEST(SE2, BetweenJacobiansAreTheNumericalOnes) {
  RandomInputs random(6);
  for (int i = 0; i < kPoses; ++i) {
    const SE2 a = random.pose(10.0);
    const SE2 b = random.pose(10.0);
    Eigen::Matrix3d J_out_a;
    Eigen::Matrix3d J_out_b;
    between(a, b, &J_out_a, &J_out_b);
    ASSERT_TRUE(matricesNear(J_out_a, numericalJacobian([&](const SE2& x) { return between(x, b); }, a), 1e-8));
    ASSERT_TRUE(matricesNear(J_out_b, numericalJacobian([&](const SE2& x) { return between(a, x); }, b), 1e-8));
  }
}

TEST(SE2, JacobiansHoldWhereTheYawWraps) {
  const SE2 a(1.0, 2.0, M_PI);
  const SE2 b(3.0, -1.0, 0.0);
  Eigen::Matrix3d J_out_a;
  Eigen::Matrix3d J_out_b;
  compose(a, b, &J_out_a, &J_out_b);
  EXPECT_TRUE(matricesNear(J_out_a, numericalJacobian([&](const SE2& x) { return compose(x, b); }, a), 1e-8));
  EXPECT_TRUE(matricesNear(J_out_b, numericalJacobian([&](const SE2& x) { return compose(a, x); }, b), 1e-8));
}

TEST(SE2, ErrorIsTheShortWayRound) {
  const SE2 left(1.0, 2.0, 179.0 * kDegree);
  const SE2 right(0.5, 4.0, -179.0 * kDegree);
  EXPECT_TRUE(matricesNear(error(left, right), Eigen::Vector3d(0.5, -2.0, -2.0 * kDegree), 1e-14));
  EXPECT_TRUE(matricesNear(error(right, left), Eigen::Vector3d(-0.5, 2.0, 2.0 * kDegree), 1e-14));
}

TEST(SE2, CorrectionCrossesPi) {
  const SE2 left(1.0, 2.0, 179.0 * kDegree);
  EXPECT_TRUE(matricesNear(corrected(left, Eigen::Vector3d(0.5, -1.0, 2.0 * kDegree)).vector(),
                           Eigen::Vector3d(1.5, 1.0, -179.0 * kDegree), 1e-14));
}

TEST(SE2, CorrectionUndoesError) {
  RandomInputs random(7);
  for (int i = 0; i < kPoses; ++i) {
    const SE2 a = random.pose(10.0);
    const SE2 b = random.pose(10.0);
    ASSERT_TRUE(posesNear(corrected(b, error(a, b)), a, 1e-14));
    const Eigen::Vector3d e(random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0), random.uniform(-3.14, 3.14));
    ASSERT_TRUE(matricesNear(error(corrected(a, e), a), e, 1e-14));
  }
}

}  // namespace
}  // namespace sckf
