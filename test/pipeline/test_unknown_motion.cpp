#include <gtest/gtest.h>

#include "core/matrix_matchers.h"
#include "sckf_odometry/pipeline/unknown_motion.h"

namespace sckf {
namespace {

constexpr double kMemory = 1.0;

Stamp ms(int count) { return std::chrono::milliseconds(count); }

TEST(MotionLimits, AreSpeedTimesTimeAndASlack) {
  MotionLimits limits;
  limits.max_speed = 2.0;
  limits.max_yaw_rate = 3.0;
  limits.slack_translation = 0.1;
  limits.slack_yaw = 0.2;
  EXPECT_TRUE(isPossible(SE2(1.09, 0, 0), 0.5, limits));
  EXPECT_FALSE(isPossible(SE2(1.11, 0, 0), 0.5, limits));
  EXPECT_FALSE(isPossible(SE2(-0.8, 0.8, 0), 0.5, limits)) << "the way, in any direction";
  EXPECT_TRUE(isPossible(SE2(0, 0, 1.69), 0.5, limits));
  EXPECT_FALSE(isPossible(SE2(0, 0, 1.71), 0.5, limits));
  EXPECT_FALSE(isPossible(SE2(0, 0, -1.71), 0.5, limits));
  EXPECT_TRUE(isPossible(SE2(0.09, 0, 0.19), 0.0, limits)) << "in no time the slack";
}

TEST(MotionLimits, OfAVelocityHaveNoSlack) {
  MotionLimits limits;
  limits.max_speed = 2.0;
  limits.max_yaw_rate = 3.0;
  EXPECT_TRUE(isPossible(Eigen::Vector3d(1.4, -1.4, -2.99), limits));
  EXPECT_FALSE(isPossible(Eigen::Vector3d(1.5, -1.4, 0.0), limits));
  EXPECT_FALSE(isPossible(Eigen::Vector3d(0.0, 0.0, -3.01), limits));
}

/// 1 m/s and 0.5 rad/s for 0.4 s: along an arc of 0.4 m and 0.2 rad, whose chord points ahead by half of it.
TEST(MotionGuess, KeepsItsVelocityOnAnArc) {
  const MotionGuess guess{{1.0, 0.0, 0.5}, ms(100)};
  const OdometryIncrement increment = guessedIncrement(guess, ms(100), ms(500), kMemory, {});
  EXPECT_NEAR(increment.before_from_after.x, 0.4 * std::cos(0.1), 1e-12);
  EXPECT_NEAR(increment.before_from_after.y, 0.4 * std::sin(0.1), 1e-12);
  EXPECT_NEAR(increment.before_from_after.yaw, 0.2, 1e-12);
  const double x_std = 0.5 * 0.4;
  const double yaw_std = 0.7 * 0.4;
  const Eigen::Vector3d variance(x_std * x_std, x_std * x_std, yaw_std * yaw_std);
  EXPECT_TRUE(matricesNear(increment.covariance, variance.asDiagonal().toDenseMatrix(), 1e-12));
}

/// A robot that was last seen at 1 m/s an hour ago is not taken to be an hour's way off, nor to be anywhere on earth.
TEST(MotionGuess, StandsAfterAWhileAndIsNotKnownBetterForThat) {
  const MotionGuess guess{{1.0, 0.0, 0.0}, ms(0)};
  const OdometryIncrement hour = guessedIncrement(guess, ms(0), ms(3600000), kMemory, {});
  EXPECT_NEAR(hour.before_from_after.x, kMemory, 1e-9);
  EXPECT_NEAR(std::sqrt(hour.covariance(0, 0)), 0.5 * std::sqrt(2.0 * 3600.0 - 1.0), 1e-9);
  const OdometryIncrement later = guessedIncrement(guess, ms(2000), ms(3000), kMemory, {});
  EXPECT_EQ(later.before_from_after.x, 0.0);
  EXPECT_NEAR(later.covariance(0, 0), 0.25 * 2.0, 1e-12);
}

TEST(MotionGuess, IsTheSumOfItsParts) {
  const MotionGuess guess{{0.8, -0.2, 0.6}, ms(0)};
  const OdometryIncrement whole = guessedIncrement(guess, ms(200), ms(2600), kMemory, {});
  SE2 motion;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (int i = 200; i < 2600; i += 40) {
    const OdometryIncrement part = guessedIncrement(guess, ms(i), ms(i + 40), kMemory, {});
    motion = compose(motion, part.before_from_after);
    covariance += part.covariance;
  }
  EXPECT_TRUE(matricesNear(covariance, whole.covariance, 1e-12));
  EXPECT_LT(error(motion, whole.before_from_after).cwiseAbs().maxCoeff(), 0.01);
}

}  // namespace
}  // namespace sckf
