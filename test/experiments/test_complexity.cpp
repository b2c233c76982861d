#include <gtest/gtest.h>

#include <cmath>

#include "core/matrix_matchers.h"
#include "core/random_inputs.h"
#include "sckf_odometry/core/joint_covariance.h"
#include "sckf_odometry/experiments/complexity.h"

namespace sckf {
namespace {

/// The one matrix and the blocks: the same pose at the end, if clone and ranges are corrected in the one and not in the
/// other or not makes no difference to it.
TEST(DenseUpdate, GivesThePoseTheSameCovariance) {
  constexpr int kRanges = 9;
  RandomInputs random(141);
  const Eigen::Matrix3d P_0 = random.covariance(3, 0.3);
  const Eigen::VectorXd R = random.rangeVariances(kRanges, 0.01, 0.1);
  JointCovariance blocks(P_0);
  blocks.cloneFromPose(Eigen::MatrixXd::Zero(3, kRanges), R);
  const Eigen::Matrix3d Q = random.covariance(3, 0.2);
  blocks.propagate(Eigen::Matrix3d::Identity(), Q);
  Eigen::MatrixXd P = Eigen::MatrixXd::Zero(6 + kRanges, 6 + kRanges);
  P.topLeftCorner<6, 6>() = P_0.replicate(2, 2);
  P.block<3, 3>(3, 3) += Q;
  P.bottomRightCorner(kRanges, kRanges) = R.asDiagonal();

  Innovation r;
  r.residual = Eigen::Vector3d::Zero();
  r.H_clone = random.gaussian(3, 3);
  r.H_pose = random.gaussian(3, 3);
  r.noise = random.covariance(3, 0.1);
  const Eigen::MatrixXd J = random.gaussian(3, kRanges);
  Eigen::MatrixXd H(3, 6 + kRanges);
  H << r.H_clone, r.H_pose, J;
  blocks.weigh(J, r);
  blocks.update(J, r);
  denseUpdate(H, r.noise, P);
  EXPECT_TRUE(matricesNear(blocks.pose(), (P.block<3, 3>(3, 3)), 1e-12));
}

/// A timing, and so with generous bounds: linear, constant and quadratic are far apart over a factor of 16.
TEST(Complexity, IsLinearForTheScKf) {
  constexpr double kFactor = 16.0;
  const auto times = measureUpdates({512, 8192}, 0, [] {});
  const double slope = std::log(times[1].sckf / times[0].sckf) / std::log(kFactor);
  EXPECT_GT(slope, 0.5);
  EXPECT_LT(slope, 1.5);
  EXPECT_LT(std::log(times[1].sckf_nc / times[0].sckf_nc) / std::log(kFactor), 0.4);
  EXPECT_EQ(times[0].dense, 0.0) << "not asked for";
}

/// … and for the filter with several clones linear in the ranges, quadratic at most in the number of states.
TEST(Complexity, OfSeveralClonesIsLinearInTheRangesAndQuadraticInTheStates) {
  const std::vector<StateSize> sizes{{3, 0, 512}, {3, 0, 8192}, {4, 0, 360}, {32, 0, 360}, {2, 8, 360}, {2, 128, 360}};
  const std::vector<double> times = measureUpdates(sizes, [] {});
  const auto slope = [&](std::size_t i, double factor) { return std::log(times[i + 1] / times[i]) / std::log(factor); };
  const auto states = [&](std::size_t i) { return static_cast<double>(sizes[i + 1].states()) / sizes[i].states(); };
  EXPECT_GT(slope(0, 16.0), 0.5);
  EXPECT_LT(slope(0, 16.0), 1.5);
  for (const std::size_t i : {2U, 4U}) {
    EXPECT_GT(slope(i, states(i)), 0.3) << "what is in the state costs";
    EXPECT_LT(slope(i, states(i)), 2.6);
  }
}

}  // namespace
}  // namespace sckf
