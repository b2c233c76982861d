// The filter with several clones: against dense matrices, against Algorithm 1, and what it must never learn.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <string>
#include <vector>

#include "core/matrix_matchers.h"
#include "core/random_inputs.h"
#include "sckf_odometry/core/multi_clone_filter.h"
#include "sckf_odometry/core/stochastic_cloning_filter.h"

namespace sckf {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;

Matrix3d additive(const SE2& pose) {
  Matrix3d T = Matrix3d::Identity();
  T(0, 2) = -pose.y;
  T(1, 2) = pose.x;
  return T;
}

/// exp(ξ) as the power series of the 3 × 3 matrix that it is defined by.
SE2 exponential(const Eigen::Vector3d& xi) {
  Matrix3d generator = Matrix3d::Zero();
  generator << 0, -xi.z(), xi.x(), xi.z(), 0, xi.y(), 0, 0, 0;
  Matrix3d sum = Matrix3d::Identity();
  Matrix3d term = Matrix3d::Identity();
  for (int i = 1; i < 30; ++i) {
    term = term * generator / i;
    sum += term;
  }
  return {sum(0, 2), sum(1, 2), std::atan2(sum(1, 0), sum(0, 0))};
}

/// ξ of a displacement: exp(ξ) has the translation V(θ) ρ.
Eigen::Vector3d logarithm(const SE2& d) {
  const double yaw = d.yaw;
  Eigen::Matrix2d V = Eigen::Matrix2d::Identity();
  if (std::abs(yaw) > 1e-9) V << std::sin(yaw), std::cos(yaw) - 1.0, 1.0 - std::cos(yaw), std::sin(yaw);
  if (std::abs(yaw) > 1e-9) V /= yaw;
  Eigen::Vector3d xi;
  xi << V.inverse() * d.translation(), yaw;
  return xi;
}

/// The rows and columns of those indices.
MatrixXd partOf(const MatrixXd& matrix, const std::vector<Eigen::Index>& indices) {
  const auto n = static_cast<Eigen::Index>(indices.size());
  return MatrixXd::NullaryExpr(n, n, [&](Eigen::Index row, Eigen::Index column) {
    return matrix(indices[static_cast<std::size_t>(row)], indices[static_cast<std::size_t>(column)]);
  });
}

/// One covariance matrix of all ξ and of all range noise, and nothing folded, skipped or shared:
///   [ ξ (pose);  ξ of each clone, the newest first;  z̃ of each clone;  z̃ of the present scan ]
class DenseMultiCloneFilter {
 public:
  DenseMultiCloneFilter(const SE2& pose, const Matrix3d& covariance) : poses_{pose} {
    const Matrix3d T_inverse = additive(pose).inverse();
    P_ = T_inverse * covariance * T_inverse.transpose();
  }

  const std::vector<SE2>& poses() const { return poses_; }
  Matrix3d covariance() const { return additive(poses_[0]) * P_.topLeftCorner(3, 3) * additive(poses_[0]).transpose(); }

  void propagate(const OdometryIncrement& u) {
    Matrix3d G;
    poses_[0] = compose(poses_[0], u.before_from_after, nullptr, &G);
    const Matrix3d W = additive(poses_[0]).inverse() * G;
    P_.topLeftCorner(3, 3) += W * u.covariance * W.transpose();
  }

  /// The present scan's noise joins the state.
  void begin(const Eigen::VectorXd& variances) {
    const Index n = P_.rows();
    P_.conservativeResize(n + variances.size(), n + variances.size());
    P_.rightCols(variances.size()).setZero();
    P_.bottomRows(variances.size()).setZero();
    P_.bottomRightCorner(variances.size(), variances.size()) = variances.asDiagonal();
    sizes_.push_back(variances.size());
  }

  /// Returns r and S.
  std::pair<Eigen::VectorXd, MatrixXd> update(const Displacement& z) {
    Matrix3d J_k;
    Matrix3d J;
    const SE2 predicted = between(poses_[z.clone + 1], poses_[0], &J_k, &J);
    MatrixXd H = MatrixXd::Zero(z.dimension(), P_.rows());
    H.leftCols(3) = z.observable * J * additive(poses_[0]);
    H.middleCols(3 * static_cast<Index>(z.clone + 1), 3) = z.observable * J_k * additive(poses_[z.clone + 1]);
    H.middleCols(firstRange(z.clone), sizes_[z.clone]) = z.J_reference;
    H.rightCols(sizes_.back()) = z.J_current;
    const MatrixXd V = z.observable;
    const Eigen::Vector3d seen =
        V.transpose() * (V * V.transpose()).inverse() * V * error(z.reference_from_current, predicted);
    const SE2 measured = compose(poses_[z.clone + 1], corrected(predicted, seen));
    const Eigen::VectorXd r = z.observable * J * additive(poses_[0]) * logarithm(compose(measured, inverse(poses_[0])));
    const MatrixXd S = H * P_ * H.transpose() + z.matching_noise;
    MatrixXd K = P_ * H.transpose() * S.inverse();
    const Index corrected = z.clone == 0 ? 3 : 3 * static_cast<Index>(poses_.size());
    K.bottomRows(K.rows() - corrected).setZero();
    const MatrixXd I_KH = MatrixXd::Identity(P_.rows(), P_.rows()) - K * H;
    P_ = I_KH * P_ * I_KH.transpose() + K * z.matching_noise * K.transpose();
    const Eigen::VectorXd correction = K * r;
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      poses_[i] = compose(exponential(correction.segment<3>(3 * static_cast<Index>(i))), poses_[i]);
    }
    return {r, S};
  }

  /// The present scan, which has begun, becomes a clone.
  void clone() {
    const Index n = P_.rows();
    const Index M = sizes_.back();
    std::vector<Index> from{0, 1, 2};
    for (Index i = 0; i < 3 * static_cast<Index>(poses_.size()); ++i) from.push_back(i);
    for (Index i = n - M; i < n; ++i) from.push_back(i);
    for (Index i = 3 * static_cast<Index>(poses_.size()); i < n - M; ++i) from.push_back(i);
    P_ = partOf(P_, from);
    poses_.insert(poses_.begin(), poses_.front());
    sizes_.insert(sizes_.begin(), M);
    sizes_.pop_back();
  }

  void forget(std::size_t clone) {
    std::vector<Index> kept;
    const Index row = 3 * static_cast<Index>(clone + 1);
    for (Index i = 0; i < P_.rows(); ++i) {
      const bool is_pose = i >= row && i < row + 3;
      const bool is_range = i >= firstRange(clone) && i < firstRange(clone) + sizes_[clone];
      if (!is_pose && !is_range) kept.push_back(i);
    }
    P_ = partOf(P_, kept);
    poses_.erase(poses_.begin() + static_cast<std::ptrdiff_t>(clone) + 1);
    sizes_.erase(sizes_.begin() + static_cast<std::ptrdiff_t>(clone));
  }

  std::size_t clones() const { return poses_.size() - 1; }
  Eigen::VectorXd variances(std::size_t clone) const { return P_.diagonal().segment(firstRange(clone), sizes_[clone]); }

 private:
  Index firstRange(std::size_t clone) const {
    Index first = 3 * static_cast<Index>(poses_.size());
    for (std::size_t i = 0; i < clone; ++i) first += sizes_[i];
    return first;
  }

  std::vector<SE2> poses_;
  std::vector<Index> sizes_;  // of the range noise of each clone and of the present scan
  MatrixXd P_;
};

TEST(MultiCloneFilter, IsTheDenseFilterAtEveryStep) {
  RandomInputs random(81);
  for (int run = 0; run < 20; ++run) {
    const SE2 start = random.pose(5.0);
    const Matrix3d P_0 = random.covariance(3, 0.1);
    MultiCloneFilter filter(start, P_0);
    DenseMultiCloneFilter dense(start, P_0);
    for (int scan = 0; scan < 25 && !HasFailure(); ++scan) {
      SCOPED_TRACE("run " + std::to_string(run) + ", scan " + std::to_string(scan));
      for (int i = random.integer(0, 3); i >= 0; --i) {
        const OdometryIncrement u = random.increment(0.03);
        filter.propagate(u);
        dense.propagate(u);
      }
      const Eigen::VectorXd R = random.rangeVariances(random.integer(1, 8), 0.005, 0.1);
      dense.begin(R);
      for (std::size_t clone = 0; clone < dense.clones(); ++clone) {
        if (random.uniform(0.0, 1.0) < 0.3) continue;
        const SE2 predicted = filter.predictedDisplacementFrom(clone).reference_from_current;
        Displacement z = random.displacement(predicted, random.integer(1, 3), dense.variances(clone), R, 0.02);
        z.clone = clone;
        const Innovation r = filter.innovation(z);
        filter.update(z, r);
        const auto [residual, S] = dense.update(z);
        EXPECT_TRUE(matricesNear(r.residual, residual, 1e-9));
        EXPECT_TRUE(matricesClose(r.covariance, S, 1e-8));
        EXPECT_TRUE(matricesNear(filter.pose().vector(), dense.poses()[0].vector(), 1e-8));
        EXPECT_TRUE(matricesClose(filter.covariance(), dense.covariance(), 1e-8));
      }
      if (random.uniform(0.0, 1.0) < 0.5) {
        const Matrix3d Q = random.covariance(3, 0.01);
        filter.loosen(Q);
        dense.propagate({SE2(), Q});
      }
      filter.clone(R);
      dense.clone();
      if (dense.clones() > 4) {
        const auto gone = static_cast<std::size_t>(random.integer(0, 4));
        filter.forget(gone);
        dense.forget(gone);
      }
      ASSERT_EQ(filter.clones(), dense.clones());
      for (std::size_t clone = 0; clone < dense.clones(); ++clone) {
        EXPECT_TRUE(matricesNear(filter.clonedPose(clone).vector(), dense.poses()[clone + 1].vector(), 1e-8));
      }
    }
  }
}

/// Where corrections are small, the two error states say the same.
TEST(MultiCloneFilter, WithOneCloneIsAlgorithm1) {
  RandomInputs random(82);
  const SE2 start(0.4, -0.3, 0.7);
  const Matrix3d P_0 = random.covariance(3, 1e-5);
  MultiCloneFilter filter(start, P_0);
  StochasticCloningFilter paper(start, P_0);
  for (int scan = 0; scan < 40; ++scan) {
    SCOPED_TRACE("scan " + std::to_string(scan));
    const OdometryIncrement u = random.increment(1e-5);
    filter.propagate(u);
    paper.propagate(u);
    const Eigen::VectorXd R = random.rangeVariances(6, 1e-6, 1e-5);
    if (scan > 0) {
      Displacement z =
          random.displacement(SE2(), random.integer(1, 3), paper.jointCovariance().rangeVariances(), R, 1e-5);
      z.reference_from_current =
          corrected(paper.predictedDisplacement().reference_from_current, 1e-5 * random.gaussian(3));
      const Innovation r = filter.innovation(z);
      const Innovation r_paper = paper.innovation(z);
      EXPECT_TRUE(matricesClose(r.covariance, r_paper.covariance, 1e-3));
      EXPECT_TRUE(matricesClose(r.gain, r_paper.gain, 1e-3));
      filter.update(z, r);
      paper.update(z, r_paper);
      EXPECT_TRUE(matricesNear(filter.pose().vector(), paper.pose().vector(), 1e-8));
      EXPECT_TRUE(matricesClose(filter.covariance(), paper.covariance(), 1e-3));
    }
    if (scan % 3 == 0) {
      filter.clone(R);
      paper.clone(R);
      while (filter.clones() > 1) filter.forget(1);
    }
  }
}

TEST(MultiCloneFilter, TurnsAPoseFarFromTheOriginAboutItself) {
  // The yaw of the clone's successor is measured 0.2 rad off, 1 km away from the origin: it turns, and stays where it
  // is.
  const SE2 far(1000.0, 500.0, 0.3);
  MultiCloneFilter filter(far, Matrix3d::Zero());
  filter.clone(Eigen::VectorXd::Constant(1, 1e-4));
  filter.propagate({SE2(), Eigen::Vector3d(1e-6, 1e-6, 0.04).asDiagonal()});
  Displacement z;
  z.reference_from_current = SE2(0.0, 0.0, 0.2);
  z.J_reference = z.J_current = MatrixXd::Zero(3, 1);
  z.variance_reference = z.variance_current = Eigen::VectorXd::Constant(1, 1e-4);
  z.matching_noise = 1e-8 * Matrix3d::Identity();
  filter.update(z, filter.innovation(z));
  EXPECT_NEAR(filter.pose().yaw, 0.5, 1e-5);
  EXPECT_LT((filter.pose().translation() - far.translation()).norm(), 1e-3);
}

/// The error of the yaw displaces what is far from where the estimate began by as much: numbers that large must not
/// hide those of a displacement.
TEST(MultiCloneFilter, TellsMillimetresHundredsOfMetresAwayWhereNothingIsKnownOfPlaceAndYaw) {
  RandomInputs random(97);
  MultiCloneFilter filter(SE2(), Eigen::Vector3d(1e6, 1e6, 39.0).asDiagonal(), {});
  const Eigen::VectorXd R = Eigen::VectorXd::Constant(4, 1e-4);
  SE2 truth;
  SE2 reference;
  double nis = 0.0;
  constexpr int kScans = 2000;
  for (int i = 0; i < kScans; ++i) {
    filter.clone(R);
    if (filter.clones() > 8) filter.forget(8);
    reference = truth;
    const SE2 step(0.9, 0.0, 0.9 / 300.0);
    const Eigen::Matrix3d Q = Eigen::Vector3d(2e-3, 2e-3, 1e-2).asDiagonal();
    truth = compose(truth, step);
    filter.propagate({corrected(step, random.drawnFrom(Q)), Q});
    filter.beginScan();
    Displacement z;
    z.matching_noise = Eigen::Vector3d(1e-5, 1e-5, 1e-6).asDiagonal();
    z.reference_from_current = corrected(between(reference, truth), random.drawnFrom(z.matching_noise));
    z.J_reference = z.J_current = Eigen::MatrixXd::Zero(3, 4);
    z.variance_reference = z.variance_current = R;
    const Innovation innovation = filter.innovation(z);
    nis += innovation.nis() / kScans;
    filter.update(z, innovation);
    ASSERT_LT(error(filter.predictedDisplacement().reference_from_current, between(reference, truth)).norm(), 0.03)
        << "scan " << i;
  }
  EXPECT_NEAR(nis, 3.0, 0.3);
}

TEST(MultiCloneFilter, NeverLearnsWhereTheWholeIs) {
  // Pose and yaw at the start are known to 1 m and 0.3 rad, and nothing that is measured between poses can tell more.
  RandomInputs random(83);
  const Matrix3d P_0 = Eigen::Vector3d(1.0, 1.0, 0.09).asDiagonal();
  MultiCloneFilter filter(SE2(), P_0);
  for (int scan = 0; scan < 500; ++scan) {
    filter.propagate({SE2(0.3, 0.02, 0.05), random.covariance(3, 0.1)});
    const Eigen::VectorXd R = Eigen::VectorXd::Constant(4, 1e-3);
    for (std::size_t clone = 0; scan > 0 && clone < filter.clones(); ++clone) {
      Displacement z =
          random.displacement(filter.predictedDisplacementFrom(clone).reference_from_current, 3, R, R, 0.02);
      z.clone = clone;
      filter.update(z, filter.innovation(z));
    }
    filter.clone(R);
    if (filter.clones() > 5) filter.forget(5);
    ASSERT_GE(filter.covariance()(2, 2), 0.09 * (1.0 - 1e-6)) << "yaw variance at scan " << scan;
  }
}

TEST(MultiCloneFilter, AScanThatWasNotUsedIsIndependent) {
  RandomInputs random(84);
  MultiCloneFilter filter(SE2(), random.covariance(3, 0.1));
  filter.clone(Eigen::VectorXd::Constant(5, 0.01));
  EXPECT_EQ(filter.clones(), 1U) << "the start was no scan";
  filter.propagate(random.increment(0.1));
  filter.clone(Eigen::VectorXd::Constant(3, 0.04));
  ASSERT_EQ(filter.clones(), 2U);
  filter.propagate(random.increment(0.1));
  Displacement z = random.displacement(SE2(), 3, Eigen::VectorXd::Constant(3, 0.04), Eigen::VectorXd::Zero(0), 0.1);
  const Matrix3d without_ranges = filter.predictedDisplacement().covariance;
  const MatrixXd expected = z.observable * without_ranges * z.observable.transpose() + z.covariance();
  EXPECT_TRUE(matricesClose(filter.innovation(z).covariance, expected, 1e-9));
}

/// The wheels are wrong by a radian between two references. A displacement from the first, at a scan after the second,
/// tells: pose and second reference come to where they must have been, though the correction is not small.
TEST(MultiCloneFilter, ACorrectionOfARadianEndsWhereTheDisplacementSays) {
  const Eigen::VectorXd one_range = Eigen::VectorXd::Constant(1, 1e-8);
  MultiCloneFilter filter(SE2(2.0, -1.0, 0.4), 1e-6 * Matrix3d::Identity());
  filter.clone(one_range);
  const SE2 start = filter.pose();
  filter.propagate({SE2(0.5, 0.0, 0.0), 1e-8 * Matrix3d::Identity()});
  filter.distrustWheels(Matrix3d::Identity());
  filter.clone(one_range);
  filter.propagate({SE2(1.0, 0.2, 0.0), 1e-8 * Matrix3d::Identity()});
  const SE2 second = compose(start, SE2(0.4, -0.3, 1.1));
  const SE2 last = compose(second, SE2(1.0, 0.2, 0.0));
  Displacement z;
  z.clone = 1;
  z.reference_from_current = between(start, last);
  z.J_reference = z.J_current = MatrixXd::Zero(3, 1);
  z.variance_reference = z.variance_current = one_range;
  z.matching_noise = 1e-8 * Matrix3d::Identity();
  filter.update(z, filter.innovation(z));
  EXPECT_TRUE(matricesNear(filter.pose().vector(), last.vector(), 1e-3));
  EXPECT_TRUE(matricesNear(filter.clonedPose(0).vector(), second.vector(), 1e-3));
  EXPECT_TRUE(matricesNear(filter.clonedPose(1).vector(), start.vector(), 1e-3));
}

}  // namespace
}  // namespace sckf
