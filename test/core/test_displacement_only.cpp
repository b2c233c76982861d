#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/matrix_matchers.h"
#include "core/monte_carlo_covariance.h"
#include "core/random_inputs.h"
#include "sckf_odometry/core/displacement_only.h"

namespace sckf {
namespace {

using Correlations = DisplacementOnly::Correlations;

constexpr int kRanges = 12;
constexpr double kRangeStd = 0.01;
const Eigen::VectorXd kVariances = Eigen::VectorXd::Constant(kRanges, kRangeStd* kRangeStd);

/// One scan of a way: how the wheels bring the robot there, what matching it to the reference sees, what then.
struct Leg {
  SE2 moved;
  Eigen::Matrix3d Q = Eigen::Matrix3d::Zero();  // of the wheels
  int directions = 3;                           // that the displacement sees; 0: there is none
  bool new_reference = true;
};

/// A way with what is measured on it, all but the errors.
class Way {
 public:
  Way(const std::vector<Leg>& legs, RandomInputs& random) : legs_(legs), P_0_(random.covariance(3, 0.004)) {
    const Eigen::Matrix3d orthogonal = random.orthogonal(3);
    SE2 reference_from_current;
    Eigen::MatrixXd J_before = random.gaussian(3, kRanges);
    for (const Leg& leg : legs_) {
      reference_from_current = compose(reference_from_current, leg.moved);
      Displacement z;
      z.reference_from_current = reference_from_current;
      z.observable = orthogonal.topRows(leg.directions);
      // What a scan adds to one displacement it takes from the next, mostly.
      z.J_reference = z.observable * (-0.9 * J_before + 0.4 * random.gaussian(3, kRanges));
      const Eigen::MatrixXd J_current = random.gaussian(3, kRanges);
      z.J_current = z.observable * J_current;
      z.variance_reference = z.variance_current = kVariances;
      z.matching_noise = random.covariance(leg.directions, 0.003);
      displacements_.push_back(z);
      if (!leg.new_reference) continue;
      J_before = J_current;
      reference_from_current = SE2();
    }
  }

  /// The robot at the end by the true motions, and by measurements with the errors drawn; without errors if random is
  /// null, for the covariance.
  DisplacementOnly travel(RandomInputs* random, Correlations correlations = Correlations::kKept) const {
    const auto draw = [random](const Eigen::MatrixXd& P) -> Eigen::VectorXd {
      return random != nullptr ? random->drawnFrom(P) : Eigen::VectorXd::Zero(P.rows());
    };
    const auto drawRanges = [random]() -> Eigen::VectorXd {
      if (random == nullptr) return Eigen::VectorXd::Zero(kRanges);
      return kRangeStd * random->gaussian(kRanges);
    };
    DisplacementOnly method(corrected(kStart, draw(P_0_)), P_0_, correlations);
    Eigen::VectorXd reference_noise = drawRanges();
    method.clone(kVariances);
    for (std::size_t i = 0; i < legs_.size(); ++i) {
      method.propagate({corrected(legs_[i].moved, draw(legs_[i].Q)), legs_[i].Q});
      Displacement z = displacements_[i];
      const Eigen::VectorXd noise = drawRanges();
      if (z.dimension() > 0) {
        const Eigen::VectorXd e = z.J_reference * reference_noise + z.J_current * noise + draw(z.matching_noise);
        z.reference_from_current = corrected(z.reference_from_current, z.observable.transpose() * e);
        method.update(z, method.innovation(z));
      }
      if (!legs_[i].new_reference) continue;
      method.clone(kVariances);
      reference_noise = noise;
    }
    return method;
  }

  Eigen::Matrix3d sampleCovariance(int draws, RandomInputs& random) const {
    SE2 truth = kStart;
    for (const Leg& leg : legs_) truth = compose(truth, leg.moved);
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (int i = 0; i < draws; ++i) {
      const Eigen::Vector3d e = error(truth, travel(&random).pose());
      sum += e * e.transpose();
    }
    return sum / draws;
  }

 private:
  const SE2 kStart{1.0, -2.0, 0.7};
  std::vector<Leg> legs_;
  Eigen::Matrix3d P_0_;
  std::vector<Displacement> displacements_;
};

void expectCovarianceOfErrors(const std::vector<Leg>& legs, bool wrong_without_C) {
  RandomInputs random(101);
  const Way way(legs, random);
  const Eigen::Matrix3d sampled = way.sampleCovariance(kDraws, random);
  EXPECT_TRUE(covariancesAgree(way.travel(nullptr).covariance(), sampled));
  if (!wrong_without_C) return;
  const Eigen::Matrix3d without_C = way.travel(nullptr, Correlations::kIgnored).covariance();
  EXPECT_FALSE(covariancesAgree(without_C, sampled));
  for (int i = 0; i < 3; ++i) EXPECT_GT(without_C(i, i), 1.2 * sampled(i, i)) << "number " << i;
}

TEST(DisplacementOnly, HasTheCovarianceOfTwoDisplacementsThatShareAScan) {
  expectCovarianceOfErrors({{SE2(0.5, 0.1, 0.3)}, {SE2(0.4, -0.2, -0.5)}}, true);
}

TEST(DisplacementOnly, HasTheCovarianceOfThreeDisplacementsThatShareScans) {
  expectCovarianceOfErrors({{SE2(0.5, 0.1, 0.3)}, {SE2(0.4, -0.2, -0.5)}, {SE2(0.6, 0.0, 0.2)}}, true);
}

Leg by(const SE2& moved, int directions, bool new_reference) {
  const Eigen::Vector3d std(0.02, 0.01, 0.02);
  return {moved, Eigen::Matrix3d(std.cwiseAbs2().asDiagonal()), directions, new_reference};
}

TEST(DisplacementOnly, HasTheCovarianceWhereAReferenceIsKept) {
  expectCovarianceOfErrors({by(SE2(0.5, 0.1, 0.3), 3, false), by(SE2(0.4, -0.2, -0.5), 3, true),
                            by(SE2(0.3, 0.2, 0.5), 3, false), by(SE2(0.6, 0.0, 0.2), 3, true)},
                           false);
}

TEST(DisplacementOnly, HasTheCovarianceWhereWheelsFillTheGaps) {
  expectCovarianceOfErrors(
      {by(SE2(0.5, 0.1, 0.3), 2, true), by(SE2(0.4, -0.2, -0.5), 1, false), by(SE2(0.2, 0.2, 0.4), 2, false),
       by(SE2(0.2, -0.1, 0.1), 0, true), by(SE2(0.6, 0.0, 0.2), 3, true)},
      false);
}

//  One range σ to a wall straight ahead: displacements are differences of ranges, and what the first scan of two adds
//  the second takes away. With C the way is known to √2 σ however often it was measured (40); without, to √(2n) σ (41).
TEST(DisplacementOnly, KeepsTheFirstAndTheLastRangeOnly) {
  constexpr int kSteps = 5;
  const Eigen::VectorXd R = Eigen::VectorXd::Constant(1, 0.04);
  Displacement z;
  z.reference_from_current = SE2(1.0, 0.0, 0.0);
  z.J_reference = Eigen::Vector3d(1.0, 0.0, 0.0);
  z.J_current = Eigen::Vector3d(-1.0, 0.0, 0.0);
  z.variance_reference = z.variance_current = R;
  for (const auto correlations : {Correlations::kKept, Correlations::kIgnored}) {
    DisplacementOnly method(SE2(), Eigen::Matrix3d::Zero(), correlations);
    method.clone(R);
    for (int i = 0; i < kSteps; ++i) {
      method.propagate({z.reference_from_current, Eigen::Matrix3d::Identity()});
      method.update(z, method.innovation(z));
      method.clone(R);
    }
    const double variance = correlations == Correlations::kKept ? 0.08 : 0.08 * kSteps;
    EXPECT_TRUE(matricesNear(method.pose().vector(), Eigen::Vector3d(5.0, 0.0, 0.0), 1e-12));
    EXPECT_TRUE(
        matricesNear(method.covariance(), Eigen::Vector3d(variance, 0.0, 0.0).asDiagonal().toDenseMatrix(), 1e-12));
  }
}

TEST(DisplacementOnly, GoesWhereTheScansSayWhateverTheWheelsSay) {
  RandomInputs random(103);
  DisplacementOnly method(SE2(1.0, 2.0, 0.5), random.covariance(3, 0.1));
  method.clone(kVariances);
  method.propagate(random.increment(0.001));
  const Displacement z = random.displacement(SE2(0.3, -0.2, 0.9), 3, kVariances, kVariances, 1.0);
  const Innovation r = method.innovation(z);
  const Eigen::Vector3d expected = compose(SE2(1.0, 2.0, 0.5), z.reference_from_current).vector();
  EXPECT_TRUE(matricesNear(corrected(method.pose(), r.gain * r.residual).vector(), expected, 1e-12));
  method.update(z, r);
  EXPECT_TRUE(matricesNear(method.pose().vector(), expected, 1e-12));
}

TEST(DisplacementOnly, TakesWhatIsSeenFromTheScansAndTheRestFromTheWheels) {
  RandomInputs random(104);
  DisplacementOnly method(SE2(), Eigen::Matrix3d::Zero());
  method.clone(kVariances);
  method.propagate({SE2(0.5, 0.1, 0.2), Eigen::Vector3d(0.01, 0.02, 0.03).asDiagonal().toDenseMatrix()});
  Displacement z = random.displacement(SE2(9.0, 0.3, 0.1), 2, kVariances, kVariances, 0.01);
  z.observable << 0.0, 1.0, 0.0, 0.0, 0.0, 1.0;
  method.update(z, method.innovation(z));
  const Eigen::Vector3d expected(0.5, z.reference_from_current.y, z.reference_from_current.yaw);
  EXPECT_TRUE(matricesNear(method.pose().vector(), expected, 1e-12));
  EXPECT_NEAR(method.covariance()(0, 0), 0.01, 1e-12);
  EXPECT_TRUE(matricesNear(method.covariance().bottomRightCorner<2, 2>(), z.covariance(), 1e-12));
}

/// The residual's covariance: of the wheels and of the displacement before there was one, after that of the noise that
/// the two have not in common.
TEST(DisplacementOnly, WeighsResidualsForTheGate) {
  RandomInputs random(105);
  DisplacementOnly method(SE2(), random.covariance(3, 0.1));
  method.clone(kVariances);
  const OdometryIncrement increment = random.increment(0.1);
  method.propagate(increment);
  Displacement z = random.displacement(increment.before_from_after, 3, kVariances, kVariances, 0.01);
  const Eigen::Matrix3d V = z.observable;
  Innovation r = method.innovation(z);
  EXPECT_TRUE(matricesNear(r.covariance, V * increment.covariance * V.transpose() + z.covariance(), 1e-12));
  method.update(z, r);
  r = method.innovation(z);
  EXPECT_TRUE(matricesNear(r.residual, Eigen::Vector3d::Zero(), 1e-12));
  const Eigen::Matrix3d reference = z.J_reference * kVariances.asDiagonal() * z.J_reference.transpose();
  EXPECT_TRUE(matricesNear(r.covariance, 2.0 * (z.covariance() - reference), 1e-12));
}

}  // namespace
}  // namespace sckf
