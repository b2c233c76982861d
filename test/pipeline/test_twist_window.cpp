#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "core/matrix_matchers.h"
#include "sckf_odometry/pipeline/twist_window.h"

namespace sckf {
namespace {

constexpr double kDuration = 0.2;

OdometryIncrement increment(const SE2& motion, const Eigen::Vector3d& variances = Eigen::Vector3d::Zero()) {
  return {motion, variances.asDiagonal().toDenseMatrix()};
}

bool isUnknown(const Twist& twist) {
  return twist.mean.isZero(0.0) && twist.covariance.isApprox(Twist::kUnknownVariance * Eigen::Matrix3d::Identity());
}

TEST(TwistWindow, IsUnknownUntilEnoughTimeHasPassed) {
  TwistWindow window(kDuration);
  EXPECT_TRUE(isUnknown(window.twist()));
  for (int i = 0; i < 3; ++i) {
    window.add(increment(SE2(0.05, 0, 0)), 0.0625);  // 1/16 s: sums without rounding
    EXPECT_TRUE(isUnknown(window.twist())) << i << ": " << window.twist().mean.transpose();
  }
  window.add(increment(SE2(0.05, 0, 0)), 0.0625);
  EXPECT_NEAR(window.twist().mean.x(), 0.8, 1e-12);
}

TEST(TwistWindow, OneLongIncrementIsEnough) {
  TwistWindow window(kDuration);
  window.add(increment(SE2(1.0, -0.5, 0.0)), 2.0);
  EXPECT_TRUE(matricesNear(window.twist().mean, Eigen::Vector3d(0.5, -0.25, 0.0), 1e-12));
}

/// Two steps of 0.1 m ± 1 cm in 0.1 s each: 1 m/s with a variance of 2 · 1e-4 m² / (0.2 s)².
TEST(TwistWindow, HandValue) {
  TwistWindow window(kDuration);
  for (int i = 0; i < 2; ++i) window.add(increment(SE2(0.1, 0, 0), {1e-4, 4e-4, 0.0}), 0.1);
  const Twist twist = window.twist();
  EXPECT_TRUE(matricesNear(twist.mean, Eigen::Vector3d(1, 0, 0), 1e-12));
  EXPECT_TRUE(matricesNear(twist.covariance, Eigen::Vector3d(5e-3, 2e-2, 0.0).asDiagonal().toDenseMatrix(), 1e-12));
}

/// On a circle a robot with two wheels does not move sideways, however long the window.
TEST(TwistWindow, OnACircleThereIsNoSidewaysVelocity) {
  for (const double rate : {0.3, -1.0, 2.5}) {
    TwistWindow window(0.4);
    const double step = 0.02 * rate;
    const double radius = 0.7 / rate;
    for (int i = 0; i < 50; ++i) {
      window.add(increment(SE2(radius * std::sin(step), radius * (1 - std::cos(step)), step)), 0.02);
    }
    EXPECT_TRUE(matricesNear(window.twist().mean, Eigen::Vector3d(0.7, 0.0, rate), 1e-4)) << rate << " rad/s";
  }
}

TEST(TwistWindow, FollowsAChangeOfSpeedWithinItsDuration) {
  TwistWindow window(kDuration);
  for (int i = 0; i < 50; ++i) window.add(increment(SE2(0.02, 0, 0)), 0.02);
  for (int i = 0; i < 11; ++i) window.add(increment(SE2(0.04, 0, 0)), 0.02);
  EXPECT_NEAR(window.twist().mean.x(), 2.0, 1e-9);
}

/// Drivers send what they have gathered at once: three samples 1 ms apart, then nothing for 58 ms. The robot's way is
/// in the samples as it should be on the whole, not from one to the next.
TEST(TwistWindow, BurstsDoNotShowInTheTwist) {
  TwistWindow window(kDuration);
  for (int burst = 0; burst < 20; ++burst) {
    for (const double dt : {0.058, 0.001, 0.001}) {
      window.add(increment(SE2(0.02, 0, 0.01)), dt);  // 1 m/s and 0.5 rad/s, were the steps 20 ms apart
      if (burst < 4) continue;
      const Twist twist = window.twist();
      EXPECT_NEAR(twist.mean.x(), 1.0, 0.21) << "burst " << burst;  // by one sample more or less in the window
      EXPECT_NEAR(twist.mean.z(), 0.5, 0.11) << "burst " << burst;
    }
  }
}

TEST(TwistWindow, AMotionInNoTimeIsPartOfTheWay) {
  TwistWindow window(kDuration);
  for (int i = 0; i < 20; ++i) {
    window.add(increment(SE2(0.01, 0, 0)), 0.02);
    window.add(increment(SE2(0.01, 0, 0)), 0.0);
    EXPECT_TRUE(window.twist().mean.allFinite());
  }
  EXPECT_NEAR(window.twist().mean.x(), 1.0, 0.051);
}

TEST(TwistWindow, NoTimeAtAllTellsNothing) {
  TwistWindow window(kDuration);
  for (int i = 0; i < 100; ++i) window.add(increment(SE2(0.01, 0, 0)), 0.0);
  EXPECT_TRUE(isUnknown(window.twist()));
}

TEST(TwistWindow, TheCovarianceIsSymmetricAndPositive) {
  TwistWindow window(kDuration);
  for (int i = 0; i < 100; ++i) {
    window.add(increment(SE2(0.03, 0.001 * (i % 3), 0.05 - 0.001 * i), {1e-4, 1e-4, 2e-4}), 0.005 + 0.001 * (i % 7));
    const Eigen::Matrix3d& P = window.twist().covariance;
    EXPECT_TRUE(matricesClose(P, P.transpose(), 1e-12));
    EXPECT_GT(P.determinant(), 0.0);
  }
}

}  // namespace
}  // namespace sckf
