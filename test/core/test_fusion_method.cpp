#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <memory>
#include <vector>

#include "core/matrix_matchers.h"
#include "core/random_inputs.h"
#include "sckf_odometry/core/dead_reckoning.h"
#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/core/multi_clone_filter.h"
#include "sckf_odometry/core/stochastic_cloning_filter.h"

namespace sckf {
namespace {

Eigen::Matrix3d diagonal(double xx, double yy, double yaw) { return Eigen::Vector3d(xx, yy, yaw).asDiagonal(); }

TEST(FusionMethod, IsMadeByEachOfItsNames) {
  const SE2 start(1.0, 2.0, 0.5);
  const Eigen::Matrix3d P_0 = diagonal(0.1, 0.2, 0.3);
  ASSERT_FALSE(fusionMethodNames().empty());
  EXPECT_EQ(fusionMethodNames().front(), "sckf_multi") << "the default";
  for (const std::string& name : fusionMethodNames()) {
    SCOPED_TRACE(name);
    const std::unique_ptr<FusionMethod> method = makeFusionMethod(name, start, P_0);
    ASSERT_NE(method, nullptr);
    EXPECT_TRUE(matricesNear(method->pose().vector(), start.vector(), 0.0));
    EXPECT_TRUE(matricesNear(method->covariance(), P_0, 1e-15));
  }
}

TEST(FusionMethod, IsOfTheKindThatItsNameSays) {
  const auto make = [](const char* name) { return makeFusionMethod(name, SE2(), diagonal(0.1, 0.1, 0.1)); };
  EXPECT_NE(dynamic_cast<MultiCloneFilter*>(make("sckf_multi").get()), nullptr);
  EXPECT_NE(dynamic_cast<StochasticCloningFilter*>(make("sckf").get()), nullptr);
  EXPECT_NE(dynamic_cast<StochasticCloningFilter*>(make("sckf_nc").get()), nullptr);
  EXPECT_NE(dynamic_cast<DeadReckoning*>(make("dead_reckoning").get()), nullptr);
}

TEST(FusionMethod, KeepsRangeNoiseOnlyInTheScKf) {
  for (const bool kept : {true, false}) {
    const auto method = makeFusionMethod(kept ? "sckf" : "sckf_nc", SE2(), diagonal(0.1, 0.1, 0.1));
    method->clone(Eigen::VectorXd::Ones(7));
    const auto& filter = dynamic_cast<const StochasticCloningFilter&>(*method);
    EXPECT_EQ(filter.jointCovariance().rangeVariances().size(), kept ? 7 : 0);
  }
}

TEST(FusionMethod, IsNullForANameThatThereIsNot) {
  for (const char* name : {"", "SCKF", "sckf ", "ekf"}) {
    EXPECT_EQ(makeFusionMethod(name, SE2(), diagonal(0.1, 0.1, 0.1)), nullptr) << "'" << name << "'";
  }
}

TEST(FusionMethod, StartsToPredictAnewAtEveryClone) {
  RandomInputs random(71);
  const OdometryIncrement first = random.increment(0.1);
  const OdometryIncrement second = random.increment(0.1);
  for (const std::string& name : fusionMethodNames()) {
    SCOPED_TRACE(name);
    const auto method = makeFusionMethod(name, random.pose(3.0), random.covariance(3, 0.2));
    method->propagate(first);
    method->clone(Eigen::VectorXd::Ones(5));
    EXPECT_TRUE(
        matricesNear(method->predictedDisplacement().reference_from_current.vector(), Eigen::Vector3d::Zero(), 1e-14));
    EXPECT_TRUE(matricesNear(method->predictedDisplacement().covariance, Eigen::Matrix3d::Zero(), 1e-14));
    method->propagate(second);
    const DisplacementPrediction prediction = method->predictedDisplacement();
    EXPECT_TRUE(matricesNear(prediction.reference_from_current.vector(), second.before_from_after.vector(), 1e-14));
    EXPECT_TRUE(matricesNear(prediction.covariance, second.covariance, 1e-14)) << "whatever came before";
  }
}

TEST(FusionMethod, MovesByTheWheelsAloneInTheSameWay) {
  RandomInputs random(72);
  const SE2 start = random.pose(3.0);
  const Eigen::Matrix3d P_0 = random.covariance(3, 0.2);
  std::vector<OdometryIncrement> way;
  for (int i = 0; i < 20; ++i) way.push_back(random.increment(0.05));
  DeadReckoning wheels(start, P_0);
  for (const OdometryIncrement& increment : way) wheels.propagate(increment);
  for (const std::string& name : fusionMethodNames()) {
    SCOPED_TRACE(name);
    const auto method = makeFusionMethod(name, start, P_0);
    for (const OdometryIncrement& increment : way) method->propagate(increment);
    EXPECT_TRUE(matricesNear(method->pose().vector(), wheels.pose().vector(), 1e-12));
    EXPECT_TRUE(matricesNear(method->covariance(), wheels.covariance(), 1e-12));
  }
}

//  y
//  3 +     · <-+ end at (2, 3), looking along −x
//    |     |
//    |     |       2 ahead, 1 to the right, turned left by 90°
//  1 +     ↑ start at (1, 1), looking along y
//    +-----+---+---> x
//          1   2
TEST(DeadReckoning, IsTheWheelsByHand) {
  DeadReckoning wheels(SE2(1.0, 1.0, M_PI_2), diagonal(0.0, 0.0, 0.01));
  wheels.propagate({SE2(2.0, -1.0, M_PI_2), diagonal(0.04, 0.09, 0.16)});
  EXPECT_TRUE(matricesNear(wheels.pose().vector(), Eigen::Vector3d(2.0, 3.0, M_PI), 1e-14));
  // The lever (1, 2) turned by a quarter is (−2, 1); the noise ahead lies along y, that to the left along −x.
  Eigen::Matrix3d P = 0.01 * Eigen::Vector3d(-2.0, 1.0, 1.0) * Eigen::RowVector3d(-2.0, 1.0, 1.0);
  P += diagonal(0.09, 0.04, 0.16);
  EXPECT_TRUE(matricesNear(wheels.covariance(), P, 1e-14));
}

TEST(DeadReckoning, LooksAtDisplacementsButDoesNotUseThem) {
  RandomInputs random(73);
  DeadReckoning wheels(random.pose(3.0), random.covariance(3, 0.1));
  const Eigen::VectorXd R = random.rangeVariances(6, 0.01, 0.1);
  wheels.clone(R);
  const OdometryIncrement increment = random.increment(0.1);
  wheels.propagate(increment);
  const SE2 pose = wheels.pose();
  const Eigen::Matrix3d covariance = wheels.covariance();
  for (int d = 1; d <= 3; ++d) {
    const Displacement z = random.displacement(increment.before_from_after, d, R, R, 0.02);
    const Innovation r = wheels.innovation(z);
    const Eigen::Vector3d difference = error(z.reference_from_current, increment.before_from_after);
    const Eigen::MatrixXd S = z.observable * increment.covariance * z.observable.transpose() + z.covariance();
    EXPECT_TRUE(matricesNear(r.residual, z.observable * difference, 1e-14));
    EXPECT_TRUE(matricesNear(r.covariance, S, 1e-14));
    EXPECT_TRUE(matricesNear(r.gain, Eigen::MatrixXd::Zero(3, d), 0.0));
    wheels.update(z, r);
    EXPECT_TRUE(matricesNear(wheels.pose().vector(), pose.vector(), 0.0));
    EXPECT_TRUE(matricesNear(wheels.covariance(), covariance, 0.0));
  }
}

TEST(DeadReckoning, HasTheCovarianceOfItsErrors) {
  RandomInputs random(74);
  const SE2 start(1.0, -2.0, 2.5);
  const Eigen::Matrix3d P_0 = random.covariance(3, 0.01);
  std::vector<OdometryIncrement> way;
  for (int i = 0; i < 20; ++i) way.push_back({SE2(0.2, 0.0, 0.1), random.covariance(3, 0.005)});
  DeadReckoning wheels(start, P_0);
  for (const OdometryIncrement& increment : way) wheels.propagate(increment);

  constexpr int kRobots = 20000;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (int robot = 0; robot < kRobots; ++robot) {
    SE2 pose = corrected(start, random.drawnFrom(P_0));
    for (const OdometryIncrement& increment : way) {
      pose = compose(pose, corrected(increment.before_from_after, random.drawnFrom(increment.covariance)));
    }
    const Eigen::Vector3d e = error(pose, wheels.pose());
    sum += e * e.transpose();
  }
  // Whitened by the covariance that is claimed, the errors have the identity. Standard error: √(2 / 20000) = 1 %.
  const Eigen::LLT<Eigen::Matrix3d> claimed(wheels.covariance());
  const Eigen::Matrix3d half = claimed.matrixL().solve(sum / kRobots);
  const Eigen::Matrix3d white = claimed.matrixL().solve(half.transpose());
  EXPECT_TRUE(matricesNear(white, Eigen::Matrix3d::Identity(), 0.04));
}

}  // namespace
}  // namespace sckf
