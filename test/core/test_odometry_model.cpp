#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "core/matrix_matchers.h"
#include "core/monte_carlo_covariance.h"
#include "core/random_inputs.h"
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

OdometryNoise handNoise(const std::string& model) {
  OdometryNoise noise = handNoise();
  noise.model = model;
  noise.lateral_share = 0.5;
  return noise;
}

Eigen::Matrix3d covarianceOf(const std::string& model, const SE2& motion) {
  return modelledIncrement(motion, handNoise(model)).covariance;
}

/// The motion at constant velocity that is n-th of a motion.
SE2 slice(const SE2& motion, int n) {
  const auto chord = [](double angle) { return angle == 0.0 ? 1.0 : std::sin(0.5 * angle) / (0.5 * angle); };
  const Eigen::Vector2d ways =
      SE2(0.0, 0.0, -0.5 * motion.yaw).rotation() * motion.translation() / (chord(motion.yaw) * n);
  const double yaw = motion.yaw / n;
  const Eigen::Vector2d t = chord(yaw) * (SE2(0.0, 0.0, 0.5 * yaw).rotation() * ways);
  return {t.x(), t.y(), yaw};
}

/// Q of a motion put together from n equal slices, as a filter does.
Eigen::Matrix3d sliced(const std::string& model, const SE2& motion, int n) {
  const OdometryIncrement part = modelledIncrement(slice(motion, n), handNoise(model));
  SE2 pose;
  Eigen::Matrix3d P = Eigen::Matrix3d::Zero();
  for (int i = 0; i < n; ++i) {
    Eigen::Matrix3d F;
    Eigen::Matrix3d H;
    pose = compose(pose, part.before_from_after, &F, &H);
    P = F * P * F.transpose() + H * part.covariance * H.transpose();
  }
  EXPECT_TRUE(matricesNear(pose.vector(), motion.vector(), 1e-9));
  return P;
}

TEST(OdometryModel, TheDefaultIsOmnidirectional) {
  EXPECT_EQ(OdometryNoise().model, "omnidirectional");
  EXPECT_EQ(odometryModelNames().front(), "omnidirectional");
  EXPECT_TRUE(matricesNear(covarianceOf("omnidirectional", SE2(3.0, 4.0, 0.5)), diagonal(0.07, 0.07, 0.53), 1e-15));
}

TEST(OdometryModel, OfANameThatThereIsNotIsRefused) {
  try {
    covarianceOf("hovercraft", SE2());
    ADD_FAILURE() << "taken";
  } catch (const std::invalid_argument& exception) {
    EXPECT_STREQ(exception.what(),
                 "odometry model is \"hovercraft\": expected one of omnidirectional, differential, ackermann");
  }
}

TEST(OdometryModel, AMotionOfNextToNothingHasACovariance) {
  for (const std::string& model : odometryModelNames()) {
    for (const double tiny : {1e-320, 1e-188, 1e-160, 1e-30}) {
      for (const SE2& motion :
           {SE2(tiny, 0.0, 0.0), SE2(0.0, tiny, 0.0), SE2(0.0, 0.0, tiny), SE2(tiny, tiny, -tiny)}) {
        const Eigen::Matrix3d Q = covarianceOf(model, motion);
        EXPECT_TRUE(Q.allFinite()) << model << ", " << motion.vector().transpose() << "\n" << Q;
        EXPECT_LT(Q.cwiseAbs().maxCoeff(), 1e-20);
      }
    }
  }
}

TEST(OdometryModel, DifferentialStraightByHand) {
  // 2 m: ahead 0.1² · 2; to the left a quarter of it and 0.3² 2³/3 of the heading; 0.3² 2²/2 between the two.
  Eigen::Matrix3d expected;
  expected << 0.02, 0.0, 0.0, 0.0, 0.245, 0.18, 0.0, 0.18, 0.18;
  EXPECT_TRUE(matricesNear(covarianceOf("differential", SE2(2.0, 0.0, 0.0)), expected, 1e-15));
  expected(1, 2) = expected(2, 1) = -0.18;
  EXPECT_TRUE(matricesNear(covarianceOf("differential", SE2(-2.0, 0.0, 0.0)), expected, 1e-15)) << "backwards";
}

TEST(OdometryModel, DifferentialTurnOnTheSpotByHand) {
  // 0.5 rad, 0.2² per rad ahead and a quarter of it to the left, turned on the way: ∫cos² = 0.460368, ∫sin² = 0.039632,
  // ∫sin cos = 0.114924.
  Eigen::Matrix3d expected;
  expected << 0.018811, 0.003448, 0.0, 0.003448, 0.006189, 0.0, 0.0, 0.0, 0.08;
  EXPECT_TRUE(matricesNear(covarianceOf("differential", SE2(0.0, 0.0, 0.5)), expected, 1e-6));
}

/// Two wheels 0.5 m apart, each with a noise of 0.02 m/√m of its own: A forward bend of 1 m radius, 1 m long.
TEST(OdometryModel, DifferentialCorrelatesAheadAndYawAsTwoWheelsDo) {
  OdometryNoise noise = handNoise("differential");
  noise.translation_per_meter = 0.02 / std::sqrt(2.0);
  noise.yaw_per_meter = 0.02 * std::sqrt(2.0) / 0.5;
  noise.translation_per_radian = noise.yaw_per_radian = noise.lateral_share = 0.0;
  const auto covariance = [&noise](const SE2& motion) { return modelledIncrement(motion, noise).covariance; };
  // A short piece of it, so that nothing turns: right 1.25, left 0.75 of the way.
  const double way = 1e-4;
  const double right = 0.02 * 0.02 * 1.25 * way;
  const double left = 0.02 * 0.02 * 0.75 * way;
  const Eigen::Matrix3d Q = covariance(SE2(way, 0.5 * way * way, way));
  EXPECT_NEAR(Q(0, 0), 0.25 * (right + left), 1e-12);
  EXPECT_NEAR(Q(2, 2), (right + left) / 0.25, 1e-12);
  EXPECT_NEAR(Q(0, 2), 0.5 * (right - left) / 0.5, 1e-11);
  EXPECT_NEAR(covariance(SE2(-way, 0.5 * way * way, -way))(0, 2), Q(0, 2), 1e-15) << "the same way back";
  EXPECT_NEAR(covariance(SE2(way, -0.5 * way * way, -way))(0, 2), -Q(0, 2), 1e-15) << "to the right";
}

TEST(OdometryModel, AckermannStraightByHand) {
  EXPECT_TRUE(matricesNear(covarianceOf("ackermann", SE2(2.0, 0.0, 0.0)),
                           covarianceOf("differential", SE2(2.0, 0.0, 0.0)), 1e-15));
}

TEST(OdometryModel, AckermannErrsInYawWithTheWay) {
  // 1 m along an arc of 2 m radius: 0.1² · 0.5² of the way, 0.3² of the metre, 0.4² of the half radian.
  const SE2 arc(2.0 * std::sin(0.5), 2.0 * (1.0 - std::cos(0.5)), 0.5);
  const Eigen::Matrix3d Q = covarianceOf("ackermann", arc);
  EXPECT_NEAR(Q(2, 2), 0.0025 + 0.09 + 0.08, 1e-12);
  // Without noise of its own, yaw errs by half a radian per metre of what the way errs by.
  OdometryNoise noise = handNoise("ackermann");
  noise.yaw_per_meter = noise.yaw_per_radian = noise.lateral_share = 0.0;
  const Eigen::Matrix3d of_way = modelledIncrement(arc, noise).covariance;
  EXPECT_NEAR(of_way(2, 2), 0.0025, 1e-12);
  EXPECT_NEAR(of_way(0, 2), 0.1 * 0.1 * 0.5 * std::cos(0.5), 1e-6) << "more way is more of it at its end";
  EXPECT_NEAR(modelledIncrement(SE2(arc.x, -arc.y, -0.5), noise).covariance(0, 2), -of_way(0, 2), 1e-12);
  EXPECT_NEAR(modelledIncrement(inverse(arc), noise).covariance(0, 2), of_way(0, 2), 1e-12) << "backwards";
}

TEST(OdometryModel, AckermannDoesNotTurnWithoutWay) {
  EXPECT_TRUE(matricesNear(covarianceOf("ackermann", SE2(0.0, 0.0, 0.5)), diagonal(0.0, 0.0, 0.5), 1e-12))
      << "half a radian is not believed by half a rad²";
  EXPECT_TRUE(matricesNear(covarianceOf("ackermann", SE2(0.0, 0.0, 0.0)), Eigen::Matrix3d::Zero(), 0.0));
}

TEST(OdometryModel, QDoesNotDependOnHowAPathIsSliced) {
  for (const std::string model : {"differential", "ackermann"}) {
    for (const SE2& motion : {SE2(2.0, 0.0, 0.0), SE2(0.0, 0.0, 0.8), SE2(1.0, 0.3, 0.6), SE2(-0.5, 0.1, -0.4),
                              SE2(0.4, -0.3, 0.0), SE2(0.1, 0.0, 0.9)}) {
      const Eigen::Matrix3d Q = covarianceOf(model, motion);
      for (const int n : {2, 7, 50}) {
        EXPECT_TRUE(matricesNear(sliced(model, motion, n), Q, 1e-4 * Q.norm())) << model << ", " << n << " slices";
      }
    }
  }
}

TEST(OdometryModel, QIsThatOfErrorsDrawnAlongThePath) {
  constexpr int kSlices = 10;
  RandomInputs random(3);
  OdometryNoise noise;  // as by default: an error does not bend the path much
  noise.translation_per_meter = noise.translation_per_radian = 0.02;
  noise.yaw_per_meter = noise.yaw_per_radian = 0.03;
  for (const std::string model : {"differential", "ackermann"}) {
    noise.model = model;
    const SE2 motion(0.9, 0.35, 0.7);
    const OdometryIncrement part = modelledIncrement(slice(motion, kSlices), noise);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(part.covariance);
    const Eigen::Matrix3d root = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
    Eigen::Matrix3d sampled = Eigen::Matrix3d::Zero();
    for (int draw = 0; draw < kDraws; ++draw) {
      SE2 pose;
      for (int i = 0; i < kSlices; ++i) {
        pose = compose(pose, corrected(part.before_from_after, Eigen::Vector3d(root * random.gaussian(3))));
      }
      const Eigen::Vector3d e = error(pose, motion);
      sampled += e * e.transpose() / kDraws;
    }
    EXPECT_TRUE(covariancesAgree(modelledIncrement(motion, noise).covariance, sampled)) << model;
  }
}

TEST(OdometryModel, QIsACovarianceWhateverTheMotion) {
  RandomInputs random(4);
  for (int i = 0; i < 1000; ++i) {
    const double size = random.magnitude(1e-12, 1e3);
    for (const std::string& model : odometryModelNames()) {
      const SE2 motion(size * random.uniform(-1.0, 1.0), size * random.uniform(-1.0, 1.0), random.uniform(-M_PI, M_PI));
      for (const SE2& each :
           {motion, SE2(motion.x, motion.y, 0.0), SE2(0.0, 0.0, motion.yaw), SE2(0.0, motion.y, 0.1)}) {
        const Eigen::Matrix3d Q = covarianceOf(model, each);
        ASSERT_TRUE(Q.allFinite()) << model;
        EXPECT_GE(smallestEigenvalue(Q), -1e-12 * Q.norm()) << model << ": " << each.vector().transpose();
      }
    }
  }
}

TEST(StatedIncrement, HoldsTheTwistOverTheTime) {
  Eigen::Matrix3d twist_covariance;
  twist_covariance << 0.04, 0.01, 0.0, 0.01, 0.09, -0.02, 0.0, -0.02, 0.16;
  const OdometryIncrement increment = statedIncrement(SE2(0.1, 0.2, 0.3), twist_covariance, 0.5, 0.5);
  EXPECT_TRUE(matricesNear(increment.covariance, 0.25 * twist_covariance, 1e-15)) << "std [m] = std [m/s] · 0.5 s";
  EXPECT_TRUE(matricesNear(increment.before_from_after.vector(), Eigen::Vector3d(0.1, 0.2, 0.3), 0.0));
}

TEST(StatedIncrement, OfTheWholeIntervalIsThatOfItsParts) {
  const Eigen::Matrix3d twist_covariance = diagonal(0.04, 0.09, 0.16);
  Eigen::Matrix3d parts = Eigen::Matrix3d::Zero();
  for (const double dt : {0.1, 0.25, 0.15}) parts += statedIncrement(SE2(), twist_covariance, dt, 0.5).covariance;
  EXPECT_TRUE(matricesNear(parts, statedIncrement(SE2(), twist_covariance, 0.5, 0.5).covariance, 1e-15));
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
