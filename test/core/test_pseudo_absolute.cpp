#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "core/chi_squared_band.h"
#include "core/matrix_matchers.h"
#include "core/random_inputs.h"
#include "sckf_odometry/core/covariance_intersection.h"
#include "sckf_odometry/core/odometry_model.h"
#include "sckf_odometry/core/pseudo_absolute.h"
#include "sckf_odometry/experiments/room_simulation.h"

namespace sckf {
namespace {

/// The textbook's form, with inverses, and ω from a grid.
struct BruteForce {
  double omega = 0.0;
  Eigen::Matrix3d covariance;
  double trace = std::numeric_limits<double>::infinity();

  BruteForce(const Eigen::Matrix3d& P, const Eigen::MatrixXd& H, const Eigen::MatrixXd& R) {
    constexpr int kSteps = 20000;
    const Eigen::Matrix3d information = H.transpose() * R.inverse() * H;
    for (int i = 1; i < kSteps; ++i) {
      const double w = static_cast<double>(i) / kSteps;
      const Eigen::Matrix3d candidate = (w * P.inverse() + (1.0 - w) * information).inverse();
      if (candidate.trace() >= trace) continue;
      omega = w;
      covariance = candidate;
      trace = candidate.trace();
    }
  }
};

TEST(CovarianceIntersection, IsThatOfTheTextbook) {
  RandomInputs random(121);
  for (int i = 0; i < 20; ++i) {
    const int d = 1 + i % 3;
    const Eigen::Matrix3d P = random.covariance(3, 0.2);
    const Eigen::MatrixXd H = random.gaussian(d, 3);
    const Eigen::MatrixXd R = random.covariance(d, 0.2);
    const CovarianceIntersection fast = intersectCovariances(P, H, R);
    const BruteForce brute(P, H, R);
    EXPECT_NEAR(fast.omega, brute.omega, 2e-4);
    EXPECT_LE(fast.covariance.trace(), brute.trace * (1.0 + 1e-12));
    EXPECT_TRUE(matricesClose(fast.covariance, brute.covariance, 1e-3));
    const Eigen::MatrixXd gain =
        (1.0 - fast.omega) * fast.covariance * H.transpose() * R.inverse();  // K = P⁺ Hᵀ ((1 − ω) R⁻¹)
    EXPECT_TRUE(matricesClose(fast.gain, gain, 1e-6));
  }
}

//  x known to 1 m², y to 4 m²; measured the other way round: half of the one, half of the other, 1.6 m² each.
TEST(CovarianceIntersection, IsHalfAndHalfByHand) {
  const Eigen::Matrix3d P = Eigen::Vector3d(1.0, 4.0, 1.0).asDiagonal();
  const Eigen::Matrix3d R = Eigen::Vector3d(4.0, 1.0, 1.0).asDiagonal();
  const CovarianceIntersection both = intersectCovariances(P, Eigen::Matrix3d::Identity(), R);
  EXPECT_NEAR(both.omega, 0.5, 1e-6);
  EXPECT_TRUE(matricesNear(both.covariance, Eigen::Vector3d(1.6, 1.6, 1.0).asDiagonal().toDenseMatrix(), 1e-6));
}

TEST(CovarianceIntersection, TakesTheBetterWhereOneIsBetterInEverything) {
  RandomInputs random(122);
  const Eigen::Matrix3d small = random.covariance(3, 0.1);
  const Eigen::Matrix3d large = 2.0 * small;
  const Eigen::Matrix3d H = Eigen::Matrix3d::Identity();
  EXPECT_TRUE(matricesClose(intersectCovariances(small, H, large).covariance, small, 1e-6));
  EXPECT_TRUE(matricesClose(intersectCovariances(large, H, small).covariance, small, 1e-6));
}

TEST(CovarianceIntersection, LeavesAPoseThatIsKnownExactly) {
  RandomInputs random(123);
  const CovarianceIntersection same =
      intersectCovariances(Eigen::Matrix3d::Zero(), Eigen::Matrix3d::Identity(), random.covariance(3, 0.1));
  EXPECT_TRUE(matricesNear(same.gain, Eigen::Matrix3d::Zero(), 0.0));
  EXPECT_TRUE(matricesNear(same.covariance, Eigen::Matrix3d::Zero(), 0.0));
}

/// A cross-covariance that goes with P and R: L_P U L_Rᵀ with |U| ≤ 1; at strength 1 there is no stronger one.
Eigen::MatrixXd crossCovariance(const Eigen::MatrixXd& P, const Eigen::MatrixXd& R, double strength,
                                RandomInputs& random) {
  const Eigen::Matrix3d U = random.orthogonal(3);
  const Eigen::MatrixXd L_P = P.llt().matrixL();
  const Eigen::MatrixXd L_R = R.llt().matrixL();
  return strength * L_P * U.leftCols(R.rows()) * L_R.transpose();
}

TEST(CovarianceIntersection, IsConsistentWhateverTheCorrelation) {
  RandomInputs random(124);
  int kalman_overconfident = 0;
  for (int i = 0; i < 2000; ++i) {
    const int d = 1 + i % 3;
    const Eigen::Matrix3d P = random.covariance(3, random.magnitude(0.05, 1.0));
    const Eigen::MatrixXd H = random.gaussian(d, 3);
    const Eigen::MatrixXd R = random.covariance(d, random.magnitude(0.05, 1.0));
    const Eigen::MatrixXd P_zR = crossCovariance(P, R, i % 2 == 0 ? 1.0 : random.uniform(0.0, 1.0), random);
    // X̃⁺ = A X̃ − K z̃: the covariance of the error that fusing with a gain K leaves.
    const auto errorCovariance = [&](const Eigen::MatrixXd& K) -> Eigen::Matrix3d {
      const Eigen::Matrix3d A = Eigen::Matrix3d::Identity() - K * H;
      const Eigen::Matrix3d cross = A * P_zR * K.transpose();
      return A * P * A.transpose() + K * R * K.transpose() - cross - cross.transpose();
    };
    const CovarianceIntersection fused = intersectCovariances(P, H, R);
    EXPECT_GT(smallestEigenvalue(fused.covariance - errorCovariance(fused.gain)), -1e-9 * P.trace());
    const Eigen::MatrixXd K = P * H.transpose() * (H * P * H.transpose() + R).inverse();
    const Eigen::Matrix3d claimed = P - K * H * P;
    if (smallestEigenvalue(claimed - errorCovariance(K)) < -1e-3 * claimed.trace()) ++kalman_overconfident;
  }
  EXPECT_GT(kalman_overconfident, 1000) << "the Kalman filter's, which takes them for independent, is not";
}

/// X̂_k ⊕ z with Φ P_k Φᵀ + Γ R Γᵀ, in the frame odom, fused with the pose by the wheels as the textbook does it.
TEST(PseudoAbsolute, IsAnAbsoluteMeasurementFusedByIntersection) {
  RandomInputs random(125);
  const SE2 start = random.pose(3.0);
  const Eigen::Matrix3d P_k = random.covariance(3, 0.1);
  const Eigen::VectorXd R = random.rangeVariances(8, 0.01, 0.05);
  const OdometryIncrement wheels = random.increment(0.2);
  PseudoAbsolute method(start, P_k);
  method.clone(R);
  method.propagate(wheels);
  const SE2 pose = method.pose();
  const Eigen::Matrix3d P = method.covariance();
  Displacement z = random.displacement(wheels.before_from_after, 3, R, R, 0.02);
  z.observable.setIdentity();

  Eigen::Matrix3d Phi;
  Eigen::Matrix3d Gamma;
  const SE2 absolute = compose(start, z.reference_from_current, &Phi, &Gamma);
  const Eigen::Matrix3d R_absolute = Phi * P_k * Phi.transpose() + Gamma * z.covariance() * Gamma.transpose();
  const BruteForce brute(P, Eigen::Matrix3d::Identity(), R_absolute);
  const Eigen::Vector3d correction =
      (1.0 - brute.omega) * brute.covariance * R_absolute.inverse() * error(absolute, pose);

  method.update(z, method.innovation(z));
  EXPECT_TRUE(matricesClose(method.covariance(), brute.covariance, 1e-3));
  EXPECT_TRUE(matricesNear(method.pose().vector(), corrected(pose, correction).vector(), 1e-3 * correction.norm()));
}

TEST(PseudoAbsolute, WeighsResidualsForTheGateByTheMotionSinceTheClone) {
  RandomInputs random(126);
  PseudoAbsolute method(random.pose(3.0), random.covariance(3, 0.5));
  const Eigen::VectorXd R = random.rangeVariances(8, 0.01, 0.05);
  method.clone(R);
  const OdometryIncrement wheels = random.increment(0.1);
  method.propagate(wheels);
  const Displacement z = random.displacement(wheels.before_from_after, 2, R, R, 0.02);
  const Innovation r = method.innovation(z);
  EXPECT_TRUE(
      matricesNear(r.covariance, z.observable * wheels.covariance * z.observable.transpose() + z.covariance(), 1e-12));
}

/// In the room of the tests: no less covariance than error, for references that are kept and for such that are not.
TEST(PseudoAbsolute, IsNotOverconfident) {
  constexpr int kRuns = 100;
  const double bound = ChiSquaredBand(3, kRuns).high;
  const RoomSimulation room({{{1, 0}, 8.0}, {{-1, 0}, 8.0}, {{0, 1}, 7.0}, {{0, -1}, 7.0}}, 0.03);
  const OdometryNoise noise;
  for (const int scans_per_reference : {1, 5}) {
    double nees = 0.0;
    double relative_nees = 0.0;
    for (int run = 0; run < kRuns; ++run) {
      RandomInputs random(1000 + run);
      SE2 truth(0.0, -2.5, 0.0);
      PseudoAbsolute method(truth, Eigen::Matrix3d::Zero());
      SimulatedScan reference = room.scan(truth, random);
      method.clone(reference.variance);
      for (int scan = 1; scan <= 40; ++scan) {
        const SE2 moved(0.24, 0.0, 0.1);
        const Eigen::Matrix3d Q = modelledIncrement(moved, noise).covariance;
        method.propagate({corrected(moved, random.drawnFrom(Q)), Q});
        truth = compose(truth, moved);
        const SimulatedScan current = room.scan(truth, random);
        const Displacement z = room.match(reference, current, random);
        method.update(z, method.innovation(z));
        const DisplacementPrediction relative = method.predictedDisplacement();
        const Eigen::Vector3d e = error(between(reference.odom_from_base, truth), relative.reference_from_current);
        relative_nees += e.dot(relative.covariance.llt().solve(e)) / (40 * kRuns);
        if (scan % scans_per_reference != 0) continue;
        reference = current;
        method.clone(current.variance);
      }
      const Eigen::Vector3d e = error(truth, method.pose());
      nees += e.dot(method.covariance().llt().solve(e)) / kRuns;
    }
    EXPECT_LT(nees, bound) << "references of " << scans_per_reference << " scans";
    EXPECT_LT(relative_nees, bound) << "references of " << scans_per_reference << " scans";
  }
}

}  // namespace
}  // namespace sckf
