// The filter, which never holds its covariance as one matrix, against one that does nothing else.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cstdint>
#include <ostream>
#include <string>

#include "core/dense_filter.h"
#include "core/matrix_matchers.h"
#include "core/random_inputs.h"
#include "sckf_odometry/core/stochastic_cloning_filter.h"

namespace sckf {
namespace {

using Filter = StochasticCloningFilter;

constexpr double kDenseTolerance = 1e-9;  // relative

struct Run {
  const char* name;
  std::uint64_t seed;
  int directions_min, directions_max;
  int scans_per_reference_min, scans_per_reference_max;  // 1, 1: the paper's algorithm
  int ranges_min, ranges_max;
  double unused_scans;  // share of scans that make no update
};

/// Names the run in the output of gtest.
void PrintTo(const Run& run, std::ostream* os) { *os << run.name; }

void expectSameState(const Filter& filter, const DenseFilter& dense) {
  const JointCovariance& fast = filter.jointCovariance();
  const Eigen::MatrixXd& P = dense.covariance();
  const Eigen::Index M = dense.ranges();
  EXPECT_TRUE(matricesClose(filter.pose().vector(), dense.pose().vector(), kDenseTolerance));
  EXPECT_TRUE(matricesClose(filter.clonedPose().vector(), dense.clonedPose().vector(), kDenseTolerance));
  EXPECT_TRUE(matricesClose(fast.clone(), P.block(0, 0, 3, 3), kDenseTolerance)) << "P_kk";
  EXPECT_TRUE(matricesClose(fast.cloneWithPose(), P.block(0, 3, 3, 3), kDenseTolerance)) << "P_kX";
  EXPECT_TRUE(matricesClose(fast.pose(), P.block(3, 3, 3, 3), kDenseTolerance)) << "P_XX";
  EXPECT_TRUE(matricesClose(fast.cloneWithRanges(), P.block(0, 6, 3, M), kDenseTolerance)) << "P_kz";
  EXPECT_TRUE(matricesClose(fast.poseWithRanges(), P.block(3, 6, 3, M), kDenseTolerance)) << "P_Xz";
  EXPECT_TRUE(matricesClose(fast.rangeVariances(), P.diagonal().segment(6, M), kDenseTolerance)) << "R_k";
  EXPECT_TRUE(matricesClose(filter.covariance(), fast.pose(), 0.0));
}

void updateBoth(const Displacement& z, Filter& filter, const Displacement& z_dense, DenseFilter& dense) {
  const Innovation r = filter.innovation(z);
  filter.update(z, r);
  const DenseFilter::Step step = dense.update(z_dense);
  EXPECT_TRUE(matricesNear(r.residual, step.residual, kDenseTolerance)) << "r";
  EXPECT_TRUE(matricesClose(r.covariance, step.S, kDenseTolerance)) << "S";
  EXPECT_TRUE(matricesClose(r.gain, step.gain, kDenseTolerance)) << "K";
  EXPECT_NEAR(r.nis(), step.residual.dot(step.S.inverse() * step.residual), 1e-6 * (1.0 + r.nis()));
}

class AgainstDense : public ::testing::TestWithParam<Run> {
 protected:
  AgainstDense() : random_(GetParam().seed) {}

  Eigen::VectorXd newScan() {
    return random_.rangeVariances(random_.integer(GetParam().ranges_min, GetParam().ranges_max), 0.005, 0.1);
  }
  int newReferenceAge() {
    return random_.integer(GetParam().scans_per_reference_min, GetParam().scans_per_reference_max);
  }
  Displacement newDisplacement(const Filter& filter, const Eigen::VectorXd& scan) {
    const int d = random_.integer(GetParam().directions_min, GetParam().directions_max);
    return random_.displacement(filter.predictedDisplacement().reference_from_current, d,
                                filter.jointCovariance().rangeVariances(), scan, 0.02);
  }

  RandomInputs random_;
};

TEST_P(AgainstDense, HasTheSameStateAtEveryStep) {
  for (int run = 0; run < 50; ++run) {
    const SE2 start = random_.pose(5.0);
    const Eigen::Matrix3d P_0 = random_.covariance(3, 0.1);
    Filter filter(start, P_0);
    DenseFilter dense(start, P_0);
    int scans_left = 0;  // no reference yet: the first scan becomes it
    for (int scan = 0; scan < 30 && !HasFailure(); ++scan) {
      SCOPED_TRACE("run " + std::to_string(run) + ", scan " + std::to_string(scan));
      for (int i = random_.integer(0, 4); i >= 0; --i) {
        const OdometryIncrement increment = random_.increment(0.03);
        filter.propagate(increment);
        dense.propagate(increment);
      }
      EXPECT_TRUE(matricesNear(filter.predictedDisplacement().covariance, dense.displacementCovariance(),
                               kDenseTolerance * dense.covariance().cwiseAbs().maxCoeff()));
      const Eigen::VectorXd ranges = newScan();
      if (scan > 0 && random_.uniform(0.0, 1.0) >= GetParam().unused_scans) {
        const Displacement z = newDisplacement(filter, ranges);
        updateBoth(z, filter, z, dense);
      }
      expectSameState(filter, dense);
      if (--scans_left <= 0) {
        filter.clone(ranges);
        dense.clone(ranges);
        scans_left = newReferenceAge();
        expectSameState(filter, dense);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Runs, AgainstDense,
                         ::testing::Values(Run{"NewReferenceAtEveryScan", 11, 3, 3, 1, 1, 6, 6, 0.0},
                                           Run{"ReferencesKept", 12, 3, 3, 1, 8, 6, 6, 0.0},
                                           Run{"TwoDirections", 13, 2, 2, 1, 8, 6, 6, 0.0},
                                           Run{"OneDirection", 14, 1, 1, 1, 8, 6, 6, 0.0},
                                           Run{"OneDirectionNewReferenceAtEveryScan", 15, 1, 1, 1, 1, 6, 6, 0.0},
                                           Run{"RangesComeAndGo", 16, 1, 3, 1, 4, 1, 12, 0.0},
                                           Run{"ScansNotUsed", 17, 1, 3, 1, 4, 1, 12, 0.5},
                                           Run{"ManyRanges", 18, 1, 3, 1, 4, 25, 30, 0.1}),
                         [](const ::testing::TestParamInfo<Run>& info) { return info.param.name; });

/// The same displacement for a filter that knows nothing of scans: the whole covariance is white.
Displacement whitened(const Displacement& z) {
  Displacement white = z;
  white.J_reference = white.J_current = Eigen::MatrixXd::Zero(z.dimension(), 0);
  white.variance_reference = white.variance_current = Eigen::VectorXd(0);
  white.matching_noise = z.covariance();
  return white;
}

TEST(WithoutCorrelations, IsTheFilterWithTheWholeNoiseTakenAsWhite) {
  RandomInputs random(32);
  const Eigen::Matrix3d P_0 = random.covariance(3, 0.1);
  Filter without(SE2(), P_0, Filter::Correlations::kIgnored);
  DenseFilter dense(SE2(), P_0);
  for (int scan = 0; scan < 100; ++scan) {
    const OdometryIncrement increment = random.increment(0.05);
    without.propagate(increment);
    dense.propagate(increment);
    const Eigen::VectorXd R = random.rangeVariances(8, 0.01, 0.1);
    const SE2 predicted = without.predictedDisplacement().reference_from_current;
    const Displacement z = random.displacement(predicted, random.integer(1, 3), R, R, 0.01);
    updateBoth(z, without, whitened(z), dense);
    without.clone(R);
    dense.clone(Eigen::VectorXd(0));
    expectSameState(without, dense);
    if (::testing::Test::HasFailure()) FAIL() << "scan " << scan;
  }
}

}  // namespace
}  // namespace sckf
