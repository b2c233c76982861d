#include <gtest/gtest.h>

#include <vector>

#include "core/matrix_matchers.h"
#include "core/monte_carlo_covariance.h"
#include "core/random_inputs.h"
#include "sckf_odometry/core/displacement_covariance.h"
#include "sckf_odometry/core/se3.h"

namespace sckf {
namespace {

using Covariance = DisplacementCovariance<6>;

SE3 randomMotion(RandomInputs& random, double largest_angle = 3.0) {
  return {random.gaussian(3), rotationExp(random.gaussian(3).normalized() * random.uniform(0.1, largest_angle))};
}

template <typename Function>
Matrix6d numericalJacobian6(const Function& f, const SE3& x) {
  constexpr double kStep = 1e-5;
  Matrix6d J;
  for (int i = 0; i < 6; ++i) {
    const Vector6d e = kStep * Vector6d::Unit(i);
    J.col(i) = error(f(corrected(x, e)), f(corrected(x, -e))) / (2.0 * kStep);
  }
  return J;
}

//  A quarter turn about z, and 1 m ahead of it: ahead is y. Then a quarter turn about the new x.
TEST(SE3, ComposesByHand) {
  const SE3 a{{1.0, 2.0, 3.0}, rotationExp({0.0, 0.0, M_PI_2})};
  const SE3 b{{1.0, 0.0, 0.5}, rotationExp({M_PI_2, 0.0, 0.0})};
  const SE3 c = compose(a, b);
  EXPECT_TRUE(matricesNear(c.translation, Eigen::Vector3d(1.0, 3.0, 3.5), 1e-15));
  EXPECT_TRUE(matricesNear(c * Eigen::Vector3d(0.0, 1.0, 0.0), Eigen::Vector3d(1.0, 3.0, 4.5), 1e-15));
}

TEST(SE3, BetweenUndoesCompose) {
  RandomInputs random(111);
  for (int i = 0; i < 20; ++i) {
    const SE3 a = randomMotion(random);
    const SE3 b = randomMotion(random);
    EXPECT_TRUE(matricesNear(error(between(a, compose(a, b)), b), Vector6d::Zero(), 1e-12));
  }
}

TEST(SE3, CorrectedUndoesError) {
  RandomInputs random(112);
  for (int i = 0; i < 20; ++i) {
    const SE3 a = randomMotion(random);
    const SE3 b = randomMotion(random);
    EXPECT_TRUE(matricesNear(error(corrected(b, error(a, b)), a), Vector6d::Zero(), 1e-12));
    EXPECT_TRUE(matricesNear(rotationLog(rotationExp({1e-9, 2e-9, 0.0})), Eigen::Vector3d(1e-9, 2e-9, 0.0), 1e-22));
  }
}

TEST(SE3, ComposeHasItsJacobians) {
  RandomInputs random(113);
  for (int i = 0; i < 20; ++i) {
    const SE3 a = randomMotion(random);
    const SE3 b = randomMotion(random);
    Matrix6d J_a;
    Matrix6d J_b;
    compose(a, b, &J_a, &J_b);
    EXPECT_TRUE(matricesNear(J_a, numericalJacobian6([&b](const SE3& x) { return compose(x, b); }, a), 1e-8));
    EXPECT_TRUE(matricesNear(J_b, numericalJacobian6([&a](const SE3& x) { return compose(a, x); }, b), 1e-8));
  }
}

/// Displacements one after the other, each with the scan that the one before ended with.
class Way {
 public:
  static constexpr int kRanges = 20;
  const Eigen::VectorXd R = Eigen::VectorXd::Constant(kRanges, 0.005 * 0.005);

  Way(int steps, RandomInputs& random) {
    Eigen::MatrixXd J_before = random.gaussian(6, kRanges);
    for (int i = 0; i < steps; ++i) {
      motions_.push_back(randomMotion(random, 0.3));
      Covariance::Measurement z;
      z.seen = Matrix6d::Identity();
      z.J_reference = -0.9 * J_before + 0.4 * random.gaussian(6, kRanges);
      z.J_current = J_before = random.gaussian(6, kRanges);
      z.variance_current = R;
      z.matching_noise = random.covariance(6, 0.002);
      measurements_.push_back(z);
    }
  }

  Matrix6d covariance(Covariance::Correlations correlations) const {
    Covariance covariance(Matrix6d::Zero(), correlations);
    covariance.clone(Matrix6d::Identity(), Matrix6d::Identity(), R);
    SE3 pose;
    for (std::size_t i = 0; i < motions_.size(); ++i) {
      Matrix6d Phi;
      Matrix6d Gamma;
      pose = compose(pose, motions_[i], &Phi, &Gamma);
      covariance.replace(measurements_[i], Matrix6d::Identity());
      covariance.clone(Phi, Gamma, R);
    }
    return covariance.covariance(Matrix6d::Identity(), Matrix6d::Zero());
  }

  Matrix6d sampleCovariance(int draws, RandomInputs& random) const {
    const Eigen::MatrixXd range_std = R.cwiseSqrt().asDiagonal();
    std::vector<Eigen::MatrixXd> matching_root;
    for (const auto& z : measurements_)
      matching_root.push_back(Eigen::LLT<Eigen::MatrixXd>(z.matching_noise).matrixL());
    Matrix6d sum = Matrix6d::Zero();
    for (int draw = 0; draw < draws; ++draw) {
      SE3 truth;
      SE3 estimate;
      Eigen::VectorXd before = range_std * random.gaussian(kRanges);
      for (std::size_t i = 0; i < motions_.size(); ++i) {
        const Eigen::VectorXd noise = range_std * random.gaussian(kRanges);
        const Vector6d e = measurements_[i].J_reference * before + measurements_[i].J_current * noise +
                           matching_root[i] * random.gaussian(6);
        truth = compose(truth, motions_[i]);
        estimate = compose(estimate, corrected(motions_[i], e));
        before = noise;
      }
      const Vector6d e = error(truth, estimate);
      sum += e * e.transpose();
    }
    return sum / draws;
  }

 private:
  std::vector<SE3> motions_;
  std::vector<Covariance::Measurement> measurements_;
};

class DisplacementsInSpace : public ::testing::TestWithParam<int> {};

TEST_P(DisplacementsInSpace, HaveTheCovarianceOfTheirErrors) {
  RandomInputs random(114);
  const Way way(GetParam(), random);
  const Matrix6d sampled = way.sampleCovariance(kDraws, random);
  EXPECT_TRUE(covariancesAgree(way.covariance(Covariance::Correlations::kKept), sampled));
}

TEST_P(DisplacementsInSpace, HaveNotWithoutTheTermC) {
  RandomInputs random(115);
  const Way way(GetParam(), random);
  const Matrix6d without_C = way.covariance(Covariance::Correlations::kIgnored);
  const Matrix6d sampled = way.sampleCovariance(kDraws, random);
  EXPECT_FALSE(covariancesAgree(without_C, sampled));
  EXPECT_GT(without_C.trace(), 1.05 * sampled.trace());
}

INSTANTIATE_TEST_SUITE_P(SharedScans, DisplacementsInSpace, ::testing::Values(2, 3));

}  // namespace
}  // namespace sckf
