#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

#include "core/matrix_matchers.h"
#include "core/random_inputs.h"
#include "sckf_odometry/core/stochastic_cloning_filter.h"

namespace sckf {
namespace {

using Filter = StochasticCloningFilter;

Eigen::Matrix3d diagonal(double xx, double yy, double yaw) { return Eigen::Vector3d(xx, yy, yaw).asDiagonal(); }

/// A displacement in all three directions with white noise only.
Displacement whiteDisplacement(const SE2& reference_from_current, const Eigen::Matrix3d& covariance) {
  Displacement z;
  z.reference_from_current = reference_from_current;
  z.J_reference = z.J_current = Eigen::MatrixXd::Zero(3, 0);
  z.matching_noise = covariance;
  return z;
}

/// Only one direction of the plane is seen, with white noise.
Displacement directedDisplacement(const SE2& reference_from_current, const Eigen::Vector3d& seen, double variance) {
  Displacement z = whiteDisplacement(reference_from_current, Eigen::Matrix3d::Zero());
  z.observable = seen.transpose();
  z.J_reference = z.J_current = Eigen::MatrixXd::Zero(1, 0);
  z.matching_noise = Displacement::MatrixDD::Constant(1, 1, variance);
  return z;
}

// ---- By hand --------------------------------------------------------------------------------------------------------

TEST(StochasticCloningFilter, StartsWithACloneOfThePose) {
  RandomInputs random(21);
  const SE2 start(1.0, 2.0, 0.5);
  const Eigen::Matrix3d P_0 = random.covariance(3, 0.3);
  const Filter filter(start, P_0);
  const JointCovariance& P = filter.jointCovariance();
  EXPECT_TRUE(matricesNear(filter.pose().vector(), start.vector(), 0.0));
  EXPECT_TRUE(matricesNear(filter.clonedPose().vector(), start.vector(), 0.0));
  for (const Eigen::Matrix3d& block : {P.pose(), P.clone(), P.cloneWithPose()}) {
    EXPECT_TRUE(matricesNear(block, P_0, 0.0));
  }
  EXPECT_EQ(P.rangeVariances().size(), 0) << "no scan, no range noise";
  EXPECT_EQ(P.poseWithRanges().cols(), 0);
}

TEST(StochasticCloningFilter, FirstScanIsIndependentOfThePose) {
  Filter filter(SE2(), diagonal(0.01, 0.02, 0.03));
  filter.clone(Eigen::Vector4d(1.0, 2.0, 3.0, 4.0));
  EXPECT_TRUE(matricesNear(filter.jointCovariance().poseWithRanges(), Eigen::MatrixXd::Zero(3, 4), 0.0));
  EXPECT_TRUE(matricesNear(filter.jointCovariance().cloneWithRanges(), Eigen::MatrixXd::Zero(3, 4), 0.0));
}

TEST(StochasticCloningFilter, KnowsThatItHasNotMovedSinceTheClone) {
  RandomInputs random(22);
  Filter filter(random.pose(5.0), random.covariance(3, 0.3));
  filter.propagate(random.increment(0.1));
  filter.clone(Eigen::VectorXd::Ones(3));
  const DisplacementPrediction prediction = filter.predictedDisplacement();
  EXPECT_TRUE(matricesNear(prediction.reference_from_current.vector(), Eigen::Vector3d::Zero(), 1e-15));
  EXPECT_TRUE(matricesNear(prediction.covariance, Eigen::Matrix3d::Zero(), 1e-15)) << "however uncertain the pose is";
}

//  odom's y
//    3 +        · where the scans say that the robot is: 1.2 ahead of the clone, 0.1 to its left
//      |        + where the wheels say: 1 ahead
//      |        ↑
//    2 +        clone at (1, 2), looking along y
//      +---+----+---> x
TEST(StochasticCloningFilter, FollowsAPerfectDisplacement) {
  const Eigen::Matrix3d P_0 = diagonal(0.01, 0.04, 0.0025);
  Filter filter(SE2(1.0, 2.0, M_PI_2), P_0);
  filter.propagate({SE2(1.0, 0.0, 0.0), diagonal(0.09, 0.09, 0.01)});
  const Displacement z = whiteDisplacement(SE2(1.2, 0.1, 0.05), Eigen::Matrix3d::Zero());
  filter.update(z, filter.innovation(z));

  EXPECT_TRUE(matricesNear(filter.pose().vector(), Eigen::Vector3d(0.9, 3.2, M_PI_2 + 0.05), 1e-12));
  // What is left is the clone's error, carried over the lever (−0.1, 1.2) from the clone.
  Eigen::Matrix3d carried;
  carried << 1.0, 0.0, -1.2, 0.0, 1.0, -0.1, 0.0, 0.0, 1.0;
  EXPECT_TRUE(matricesNear(filter.covariance(), carried * P_0 * carried.transpose(), 1e-12));
  EXPECT_TRUE(matricesNear(filter.predictedDisplacement().covariance, Eigen::Matrix3d::Zero(), 1e-12));
}

TEST(StochasticCloningFilter, GainsNothingOnTheAbsolutePoseFromAKeptReference) {
  // Every displacement says something else, so that the estimate jumps, but only ever about the way from the clone.
  RandomInputs random(24);
  const Eigen::Matrix3d P_0 = diagonal(0.3, 0.4, 0.5);
  Filter filter(SE2(1.0, 2.0, 0.7), P_0);
  for (int scan = 0; scan < 200; ++scan) {
    filter.propagate(random.increment(0.05));
    Displacement z =
        whiteDisplacement(filter.predictedDisplacement().reference_from_current, diagonal(0.01, 0.01, 0.01));
    z.reference_from_current = corrected(z.reference_from_current, 0.1 * random.gaussian(3));
    filter.update(z, filter.innovation(z));
  }
  // X = X_k ⊕ displacement, and the two are independent, since nothing else is known about X_k.
  Eigen::Matrix3d J_out_clone;
  Eigen::Matrix3d J_out_displacement;
  const DisplacementPrediction prediction = filter.predictedDisplacement();
  compose(filter.clonedPose(), prediction.reference_from_current, &J_out_clone, &J_out_displacement);
  EXPECT_TRUE(matricesNear(filter.jointCovariance().cloneWithPose(), P_0 * J_out_clone.transpose(), 1e-12));
  EXPECT_TRUE(matricesNear(filter.covariance(),
                           J_out_clone * P_0 * J_out_clone.transpose() +
                               J_out_displacement * prediction.covariance * J_out_displacement.transpose(),
                           1e-12));
}

TEST(StochasticCloningFilter, WeighsWheelsAndScansByTheirVariances) {
  Filter filter(SE2(), Eigen::Matrix3d::Zero());
  filter.propagate({SE2(1.0, 0.0, 0.0), diagonal(0.03, 0.02, 0.01)});
  const Displacement z = whiteDisplacement(SE2(1.4, 0.0, 0.0), diagonal(0.01, 0.02, 0.03));
  const Innovation r = filter.innovation(z);
  EXPECT_TRUE(matricesNear(r.covariance, diagonal(0.04, 0.04, 0.04), 1e-15));
  EXPECT_TRUE(matricesNear(r.gain, diagonal(0.75, 0.5, 0.25), 1e-14));
  EXPECT_NEAR(r.nis(), 0.4 * 0.4 / 0.04, 1e-12);
  filter.update(z, r);
  EXPECT_TRUE(matricesNear(filter.pose().vector(), Eigen::Vector3d(1.3, 0.0, 0.0), 1e-14));
  EXPECT_TRUE(matricesNear(filter.covariance(), diagonal(0.0075, 0.01, 0.0075), 1e-15));
}

TEST(StochasticCloningFilter, RemembersTheNoiseOfTheScanThatItCloned) {
  // One range, seen only in x: S = 0.03 + 0.005 + 0.005, K = 0.75, P_Xz = −K J R = −0.75 · 1 · 0.005.
  Filter filter(SE2(), Eigen::Matrix3d::Zero());
  const Eigen::VectorXd R = Eigen::VectorXd::Constant(1, 0.005);
  filter.clone(R);
  filter.propagate({SE2(1.0, 0.0, 0.0), diagonal(0.03, 0.02, 0.01)});
  Displacement z = directedDisplacement(SE2(1.4, 0.0, 0.0), Eigen::Vector3d::UnitX(), 0.0);
  z.variance_reference = z.variance_current = R;
  z.J_reference = Eigen::MatrixXd::Constant(1, 1, -1.0);
  z.J_current = Eigen::MatrixXd::Constant(1, 1, 1.0);
  filter.update(z, filter.innovation(z));
  filter.clone(R);
  const Eigen::Vector3d P_Xz(-0.75 * 0.005, 0.0, 0.0);
  EXPECT_TRUE(matricesNear(filter.jointCovariance().poseWithRanges(), P_Xz, 1e-15));
  EXPECT_TRUE(matricesNear(filter.jointCovariance().cloneWithRanges(), P_Xz, 1e-15));
  EXPECT_TRUE(matricesNear(filter.jointCovariance().rangeVariances(), R, 0.0));
}

TEST(StochasticCloningFilter, LeavesADirectionThatTheScansDoNotSee) {
  // Isotropic in the plane and a look along 30°: what lies across it is independent and has to stay.
  Filter filter(SE2(), Eigen::Matrix3d::Zero());
  filter.propagate({SE2(1.0, 0.0, 0.0), diagonal(0.02, 0.02, 0.01)});
  const double angle = M_PI / 6.0;
  const Eigen::Vector3d seen(std::cos(angle), std::sin(angle), 0.0);
  const Eigen::Vector3d unseen(-std::sin(angle), std::cos(angle), 0.0);
  const Displacement z = directedDisplacement(SE2(1.3, -0.2, 0.4), seen, 0.02);
  const SE2 before = filter.pose();
  filter.update(z, filter.innovation(z));

  const Eigen::Vector3d correction = error(filter.pose(), before);
  EXPECT_NEAR(seen.dot(correction), 0.5 * seen.dot(Eigen::Vector3d(0.3, -0.2, 0.4)), 1e-14);
  EXPECT_NEAR(unseen.dot(correction), 0.0, 1e-15);
  EXPECT_NEAR(correction.z(), 0.0, 1e-15) << "the yaw is not seen and not correlated";
  EXPECT_NEAR(seen.dot(filter.covariance() * seen), 0.01, 1e-15);
  EXPECT_NEAR(unseen.dot(filter.covariance() * unseen), 0.02, 1e-15);
  EXPECT_NEAR(seen.dot(filter.covariance() * unseen), 0.0, 1e-15);
  EXPECT_NEAR(filter.covariance()(2, 2), 0.01, 1e-15);
}

TEST(StochasticCloningFilter, TakesTheShortWayRoundInTheInnovation) {
  Filter filter(SE2(0.0, 0.0, 3.0), diagonal(0.1, 0.1, 0.1));
  filter.propagate({SE2(0.0, 0.0, 3.1), diagonal(0.1, 0.1, 0.1)});
  const Displacement z = whiteDisplacement(SE2(0.0, 0.0, -3.1), diagonal(0.1, 0.1, 0.1));
  EXPECT_NEAR(filter.innovation(z).residual(2), 2.0 * M_PI - 6.2, 1e-12);
}

TEST(StochasticCloningFilter, DoesNotDriftWhileItStandsStill) {
  // One kept reference and a robot at rest: more scans only confirm, and none of them adds to the covariance.
  RandomInputs random(23);
  Filter filter(SE2(), diagonal(0.01, 0.01, 0.01));
  const Eigen::VectorXd R = random.rangeVariances(20, 0.02, 0.03);
  filter.clone(R);
  const Eigen::MatrixXd J = random.gaussian(3, 20);
  for (int scan = 0; scan < 100; ++scan) {
    filter.propagate({SE2(), Eigen::Matrix3d::Zero()});
    Displacement z = whiteDisplacement(SE2(), diagonal(1e-6, 1e-6, 1e-6));
    z.J_reference = J;
    z.J_current = -J;
    z.variance_reference = z.variance_current = R;
    filter.update(z, filter.innovation(z));
  }
  EXPECT_TRUE(matricesNear(filter.covariance(), diagonal(0.01, 0.01, 0.01), 1e-12));
}

// ---- SC-KF-NC -------------------------------------------------------------------------------------------------------

TEST(WithoutCorrelations, KeepsNoCorrelation) {
  RandomInputs random(31);
  Filter filter(SE2(), random.covariance(3, 0.1), Filter::Correlations::kIgnored);
  Eigen::VectorXd R_k = random.rangeVariances(8, 0.01, 0.1);
  for (int scan = 0; scan < 50; ++scan) {
    filter.clone(R_k);
    EXPECT_EQ(filter.jointCovariance().poseWithRanges().cols(), 0);
    EXPECT_EQ(filter.jointCovariance().cloneWithRanges().cols(), 0);
    filter.propagate(random.increment(0.05));
    const Eigen::VectorXd R = random.rangeVariances(random.integer(4, 10), 0.01, 0.1);
    const Displacement z = random.displacement(filter.predictedDisplacement().reference_from_current, 3, R_k, R, 0.01);
    filter.update(z, filter.innovation(z));
    R_k = R;
  }
}

// ---- Predicted displacement -----------------------------------------------------------------------------------------

TEST(Displacement, OfWhatIsSeenHasNothingOfWhatIsNot) {
  Displacement z;
  z.observable.resize(2, 3);
  z.observable << 0.6, 0.8, 0.0, 0.1, -0.2, 3.0;  // neither of length one nor at right angles
  const Eigen::Vector3d unseen = z.observable.row(0).transpose().cross(z.observable.row(1).transpose());
  EXPECT_TRUE(matricesNear(z.observable * z.fromObservable(), Eigen::Matrix2d::Identity(), 1e-14));
  EXPECT_TRUE(matricesNear(unseen.transpose() * z.fromObservable(), Eigen::RowVector2d::Zero(), 1e-14));
}

TEST(PredictedDisplacement, HasTheCovarianceOfItsErrors) {
  // Robots with errors drawn from the filter's own noise; the share of the start cancels, that of the way is left.
  RandomInputs random(41);
  const SE2 start(1.0, -2.0, 2.5);
  const Eigen::Matrix3d P_0 = random.covariance(3, 0.02);
  std::vector<OdometryIncrement> way;
  for (int i = 0; i < 10; ++i) way.push_back(random.increment(0.01));
  Filter filter(start, P_0);
  for (const OdometryIncrement& increment : way) filter.propagate(increment);
  const DisplacementPrediction prediction = filter.predictedDisplacement();

  constexpr int kRobots = 20000;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (int robot = 0; robot < kRobots; ++robot) {
    const SE2 clone = corrected(start, random.drawnFrom(P_0));
    SE2 pose = clone;
    for (const OdometryIncrement& increment : way) {
      pose = compose(pose, corrected(increment.before_from_after, random.drawnFrom(increment.covariance)));
    }
    const Eigen::Vector3d e = error(between(clone, pose), prediction.reference_from_current);
    sum += e * e.transpose();
  }
  // Standard error of an entry: √(2 / 20000) = 1 %.
  EXPECT_TRUE(matricesClose(sum / kRobots, prediction.covariance, 0.05));
}

// ---- Numerics and cost ----------------------------------------------------------------------------------------------

/// Whether [clone, pose] has a covariance that a covariance can be. Scaled to a unit diagonal, so that a yaw counts as
/// much as a position that is uncertain by hundreds of meters.
::testing::AssertionResult isCovariance(const JointCovariance& P) {
  Eigen::Matrix<double, 6, 6> joint;
  joint << P.clone(), P.cloneWithPose(), P.cloneWithPose().transpose(), P.pose();
  const Eigen::Matrix<double, 6, 1> scale = joint.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::Matrix<double, 6, 6> scaled = scale.asDiagonal() * joint * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(scaled, Eigen::EigenvaluesOnly);
  const bool good = scaled.allFinite() && P.poseWithRanges().allFinite() && P.cloneWithRanges().allFinite() &&
                    (scaled - scaled.transpose()).cwiseAbs().maxCoeff() <= 1e-12 &&
                    eigen.eigenvalues().minCoeff() >= -1e-9 * eigen.eigenvalues().maxCoeff();
  if (good) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << "[clone, pose]:\n"
                                       << joint << "\neigenvalues, scaled: " << eigen.eigenvalues().transpose();
}

TEST(StochasticCloningFilter, StaysACovarianceOver100000Steps) {
  RandomInputs random(51);
  Filter filter(random.pose(5.0), random.covariance(3, 0.1));
  Eigen::VectorXd scan = random.rangeVariances(10, 1e-3, 0.3);
  filter.clone(scan);
  for (int step = 0; step < 100000; ++step) {
    const double choice = random.uniform(0.0, 1.0);
    if (choice < 0.5) {
      filter.propagate(random.increment(random.magnitude(1e-4, 0.3)));
    } else if (choice < 0.85) {
      scan = random.rangeVariances(random.integer(1, 20), 1e-3, 0.3);
      Displacement z =
          random.displacement(filter.predictedDisplacement().reference_from_current, random.integer(1, 3),
                              filter.jointCovariance().rangeVariances(), scan, random.magnitude(1e-4, 0.3));
      filter.update(z, filter.innovation(z));
    } else {
      filter.clone(scan);
    }
    ASSERT_TRUE(isCovariance(filter.jointCovariance())) << "step " << step;
  }
}

/// The least of many times for an update and a clone with M ranges [s]. The least is what other programs disturb least.
double secondsPerScan(int ranges) {
  RandomInputs random(61);
  const Eigen::VectorXd R = random.rangeVariances(ranges, 0.01, 0.03);
  Filter filter(SE2(), diagonal(0.01, 0.01, 0.01));
  filter.clone(R);
  const Displacement z = random.displacement(SE2(), 3, R, R, 0.01);
  double least = 1e9;
  for (int i = 0; i < 50; ++i) {
    filter.propagate({SE2(0.1, 0.0, 0.0), diagonal(0.01, 0.01, 0.01)});
    const auto start = std::chrono::steady_clock::now();
    filter.update(z, filter.innovation(z));
    filter.clone(R);
    least = std::min(least, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  return least;
}

TEST(StochasticCloningFilter, CostsTimeLinearInTheNumberOfRanges) {
  const double few = secondsPerScan(1000);
  const double many = secondsPerScan(16000);
  EXPECT_LT(many / few, 64.0) << "16 would be linear, 256 quadratic; " << few << " s and " << many << " s";
}

}  // namespace
}  // namespace sckf
