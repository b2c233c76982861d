#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "matrix_matchers.h"
#include "sckf_odometry/core/odometry_model.h"

namespace sckf {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

OdometryNoise handNoise() {
  OdometryNoise noise;
  noise.translation_per_meter = 0.1;
  noise.translation_per_radian = 0.2;
  noise.yaw_per_meter = 0.3;
  noise.yaw_per_radian = 0.4;
  return noise;
}

Eigen::Matrix3d diagonal(double xx, double yy, double yaw) { return Eigen::Vector3d(xx, yy, yaw).asDiagonal(); }

Eigen::Matrix3d modelledCovariance(double x, double y, double yaw) {
  return modelledIncrement(SE2(x, y, yaw), handNoise()).covariance;
}

TEST(ModelledIncrement, IsTheModelByHand) {
  // 5 m of way and 0.5 rad: 0.1² · 5 + 0.2² · 0.5 = 0.07 m², 0.3² · 5 + 0.4² · 0.5 = 0.53 rad².
  const OdometryIncrement increment = modelledIncrement(SE2(3.0, 4.0, 0.5), handNoise());
  EXPECT_TRUE(matricesNear(increment.covariance, diagonal(0.07, 0.07, 0.53), 1e-15));
  EXPECT_TRUE(matricesNear(increment.before_from_after.vector(), Eigen::Vector3d(3.0, 4.0, 0.5), 0.0));
}

TEST(ModelledIncrement, HasStandardDeviationsThatAreReachedAfterOneMeterAndOneRadian) {
  EXPECT_TRUE(matricesNear(modelledCovariance(1.0, 0.0, 0.0), diagonal(0.01, 0.01, 0.09), 1e-15));
  EXPECT_TRUE(matricesNear(modelledCovariance(0.0, 0.0, 1.0), diagonal(0.04, 0.04, 0.16), 1e-15));
}

TEST(ModelledIncrement, GrowsLikeARandomWalk) {
  const Eigen::Matrix3d once = modelledCovariance(0.7, 0.0, 0.0);
  EXPECT_TRUE(matricesNear(modelledCovariance(2.8, 0.0, 0.0), 4.0 * once, 1e-15))
      << "four times the way, twice the std";
}

TEST(ModelledIncrement, DoesNotDependOnHowAStraightMotionIsSampled) {
  for (const int parts : {2, 10, 1000}) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (int i = 0; i < parts; ++i) sum += modelledCovariance(2.0 / parts, 0.0, 0.0);
    EXPECT_TRUE(matricesNear(sum, modelledCovariance(2.0, 0.0, 0.0), 1e-12)) << parts << " parts";
  }
}

TEST(ModelledIncrement, DoesNotDependOnHowATurnOnTheSpotIsSampled) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (int i = 0; i < 100; ++i) sum += modelledCovariance(0.0, 0.0, -0.02);
  EXPECT_TRUE(matricesNear(sum, modelledCovariance(0.0, 0.0, -2.0), 1e-12));
}

TEST(ModelledIncrement, HasNoNoiseAtRest) {
  EXPECT_TRUE(matricesNear(modelledCovariance(0.0, 0.0, 0.0), Eigen::Matrix3d::Zero(), 0.0));
}

TEST(ModelledIncrement, IsTheSameForwardsAndBackwards) {
  EXPECT_TRUE(matricesNear(modelledCovariance(-1.0, 0.0, -0.5), modelledCovariance(1.0, 0.0, 0.5), 0.0));
}

TEST(StatedIncrement, HoldsTheTwistOverTheTime) {
  Eigen::Matrix3d twist_covariance;
  twist_covariance << 0.04, 0.01, 0.0, 0.01, 0.09, -0.02, 0.0, -0.02, 0.16;
  const OdometryIncrement increment = statedIncrement(SE2(0.1, 0.2, 0.3), twist_covariance, 0.5);
  EXPECT_TRUE(matricesNear(increment.covariance, 0.25 * twist_covariance, 1e-15)) << "std [m] = std [m/s] · 0.5 s";
  EXPECT_TRUE(matricesNear(increment.before_from_after.vector(), Eigen::Vector3d(0.1, 0.2, 0.3), 0.0));
}

TEST(SensibleTwistCovariance, TakesWhatADriverMayMean) {
  EXPECT_TRUE(sensibleTwistCovariance(diagonal(0.01, 0.01, 0.02)));
  EXPECT_TRUE(sensibleTwistCovariance(diagonal(1e-6, 1e-6, 1e-6)));
  EXPECT_TRUE(sensibleTwistCovariance(diagonal(0.01, 0.0, 0.02))) << "a base that cannot move sideways";
  Eigen::Matrix3d correlated;
  correlated << 0.04, 0.01, 0.0, 0.01, 0.09, -0.02, 0.0, -0.02, 0.16;
  EXPECT_TRUE(sensibleTwistCovariance(correlated));
}

TEST(SensibleTwistCovariance, RefusesZero) { EXPECT_FALSE(sensibleTwistCovariance(Eigen::Matrix3d::Zero())); }

TEST(SensibleTwistCovariance, RefusesWhatIsNotFinite) {
  for (const double bad : {kNaN, kInfinity, -kInfinity}) {
    EXPECT_FALSE(sensibleTwistCovariance(diagonal(bad, 0.01, 0.01))) << bad;
    EXPECT_FALSE(sensibleTwistCovariance(diagonal(0.01, 0.01, bad))) << bad;
    Eigen::Matrix3d off_diagonal = diagonal(0.01, 0.01, 0.01);
    off_diagonal(0, 2) = off_diagonal(2, 0) = bad;
    EXPECT_FALSE(sensibleTwistCovariance(off_diagonal)) << bad;
  }
}

TEST(SensibleTwistCovariance, RefusesAsymmetric) {
  Eigen::Matrix3d asymmetric = diagonal(0.04, 0.04, 0.04);
  asymmetric(0, 1) = 0.01;
  EXPECT_FALSE(sensibleTwistCovariance(asymmetric));
}

TEST(SensibleTwistCovariance, RefusesIndefinite) {
  EXPECT_FALSE(sensibleTwistCovariance(diagonal(0.04, -0.01, 0.04)));
  Eigen::Matrix3d beyond_full_correlation = diagonal(0.04, 0.04, 0.04);
  beyond_full_correlation(0, 1) = beyond_full_correlation(1, 0) = 0.05;
  EXPECT_FALSE(sensibleTwistCovariance(beyond_full_correlation));
}

TEST(SensibleTwistCovariance, RefusesUnknown) {
  for (const double unknown : {1e3, 1e6, 1e9, std::numeric_limits<double>::max()}) {
    EXPECT_FALSE(sensibleTwistCovariance(diagonal(unknown, unknown, unknown))) << unknown;
    EXPECT_FALSE(sensibleTwistCovariance(diagonal(0.01, unknown, 0.01))) << unknown;
  }
}

}  // namespace
}  // namespace sckf
