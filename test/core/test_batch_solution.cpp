// How much the filter loses by looking at each measurement once: beside the batch solution that looks at all of them
// together, the maximum a posteriori.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <cstdint>
#include <deque>
#include <iostream>
#include <ostream>
#include <string>
#include <vector>

#include "core/random_inputs.h"
#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/core/odometry_model.h"
#include "sckf_odometry/experiments/room_simulation.h"

namespace sckf {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int kRuns = 100;
constexpr int kScans = 40;

/// All that was measured on a drive, and where the robot really was.
struct Drive {
  struct Measured {
    std::size_t reference;  // number of the scan …
    std::size_t current;    // … and of that compared with it
    Displacement z;
  };
  std::vector<SE2> truth;                    // at the scans
  std::vector<OdometryIncrement> by_wheels;  // from scan to scan
  std::vector<Measured> displacements;
};

/// As a function of all poses stacked, with the derivatives by them.
struct Linearised {
  VectorXd residual;
  MatrixXd J;
};

/// Maximum of the posterior of the poses at the scans, the first of which is known. The errors of two displacements
/// that share a scan are correlated by the noise of its ranges.
class BatchSolution {
 public:
  explicit BatchSolution(const Drive& drive) : drive_(drive), poses_{drive.truth.front()} {
    for (const OdometryIncrement& u : drive.by_wheels) poses_.push_back(compose(poses_.back(), u.before_from_after));
    const MatrixXd C = covariance();
    const Eigen::LLT<MatrixXd> factor(C);
    for (int iteration = 0; iteration < 5; ++iteration) {
      const Linearised all = linearised();
      const MatrixXd weighted = factor.solve(all.J);
      const VectorXd step = (all.J.transpose() * weighted).llt().solve(weighted.transpose() * all.residual);
      for (std::size_t k = 1; k < poses_.size(); ++k) poses_[k] = corrected(poses_[k], step.segment<3>(row(k - 1)));
    }
  }

  SE2 last() const { return poses_.back(); }

 private:
  static Index row(std::size_t block) { return static_cast<Index>(3 * block); }
  Index rows() const { return row(drive_.by_wheels.size() + drive_.displacements.size()); }

  /// First the increments of the wheels, then the displacements.
  MatrixXd covariance() const {
    MatrixXd C = MatrixXd::Zero(rows(), rows());
    const std::size_t steps = drive_.by_wheels.size();
    for (std::size_t k = 0; k < steps; ++k) C.block<3, 3>(row(k), row(k)) = drive_.by_wheels[k].covariance;
    const auto& all = drive_.displacements;
    for (std::size_t i = 0; i < all.size(); ++i) {
      for (std::size_t j = 0; j < all.size(); ++j) {
        C.block<3, 3>(row(steps + i), row(steps + j)) = common(all[i], all[j]);
      }
    }
    return C;
  }

  static Matrix3d common(const Drive::Measured& a, const Drive::Measured& b) {
    Matrix3d sum = &a == &b ? Matrix3d(a.z.matching_noise) : Matrix3d::Zero().eval();
    const auto add = [&sum](std::size_t one, const MatrixXd& J, const VectorXd& R, std::size_t other,
                            const MatrixXd& K) {
      if (one == other) sum += J * R.asDiagonal() * K.transpose();
    };
    add(a.reference, a.z.J_reference, a.z.variance_reference, b.reference, b.z.J_reference);
    add(a.reference, a.z.J_reference, a.z.variance_reference, b.current, b.z.J_current);
    add(a.current, a.z.J_current, a.z.variance_current, b.reference, b.z.J_reference);
    add(a.current, a.z.J_current, a.z.variance_current, b.current, b.z.J_current);
    return sum;
  }

  Linearised linearised() const {
    Linearised out{VectorXd(rows()), MatrixXd::Zero(rows(), row(drive_.by_wheels.size()))};
    std::size_t block = 0;
    const auto add = [&](std::size_t from, std::size_t to, const SE2& measured, const Matrix3d& seen) {
      Matrix3d by_from;
      Matrix3d by_to;
      const SE2 expected = between(poses_[from], poses_[to], &by_from, &by_to);
      out.residual.segment<3>(row(block)) = seen * error(measured, expected);
      if (from > 0) out.J.block<3, 3>(row(block), row(from - 1)) = seen * by_from;
      out.J.block<3, 3>(row(block), row(to - 1)) = seen * by_to;
      ++block;
    };
    for (std::size_t k = 0; k < drive_.by_wheels.size(); ++k) {
      add(k, k + 1, drive_.by_wheels[k].before_from_after, Matrix3d::Identity());
    }
    for (const auto& m : drive_.displacements) add(m.reference, m.current, m.z.reference_from_current, m.z.observable);
    return out;
  }

  const Drive& drive_;
  std::vector<SE2> poses_;
};

struct Case {
  std::string method;
  std::size_t scans_per_reference;
  std::size_t references;  // kept; a scan that becomes one is compared with all of them
};

std::ostream& operator<<(std::ostream& out, const Case& c) {
  return out << c.method << ", a reference every " << c.scans_per_reference << " scans, " << c.references << " kept";
}

/// Drives, lets the filter estimate, and leaves what it was given. Returns the filter's last pose.
SE2 drive(const Case& c, std::uint64_t seed, Drive& all) {
  RandomInputs random(seed);
  const RoomSimulation room(simulatedHall(), 0.03);
  OdometryNoise noise;
  noise.translation_per_meter = noise.yaw_per_meter = 0.05;
  noise.yaw_per_radian = 0.1;
  SE2 truth(0.0, -2.5, 0.0);
  const auto filter = makeFusionMethod(c.method, truth, 1e-12 * Matrix3d::Identity());
  struct Reference {
    std::size_t number;
    SimulatedScan scan;
  };
  std::deque<Reference> references{{0, room.scan(truth, random)}};
  all.truth = {truth};
  filter->clone(references.front().scan.variance);
  for (std::size_t k = 1; k <= kScans; ++k) {
    const SE2 moved(0.24, 0.0, 0.096);
    const Matrix3d Q = modelledIncrement(moved, noise).covariance;
    all.by_wheels.push_back({corrected(moved, random.drawnFrom(Q)), Q});
    filter->propagate(all.by_wheels.back());
    truth = compose(truth, moved);
    all.truth.push_back(truth);
    const SimulatedScan current = room.scan(truth, random);
    const bool new_reference = k % c.scans_per_reference == 0;
    for (std::size_t i = 0; i < (new_reference ? references.size() : 1); ++i) {
      Displacement z = room.match(references[i].scan, current, random);
      z.clone = i;
      filter->update(z, filter->innovation(z));
      all.displacements.push_back({references[i].number, k, z});
    }
    if (!new_reference) continue;
    filter->clone(current.variance);
    references.push_front({k, current});
    if (references.size() <= c.references) continue;
    references.pop_back();
    if (filter->clones() > references.size()) filter->forget(references.size());
  }
  return filter->pose();
}

class BatchSolutionOf : public ::testing::TestWithParam<Case> {};

TEST_P(BatchSolutionOf, KnowsLittleMoreThanTheFilter) {
  constexpr double kAtMost = 1.1;
  Vector3d of_filter = Vector3d::Zero();
  Vector3d of_batch = Vector3d::Zero();
  for (std::uint64_t run = 0; run < kRuns; ++run) {
    Drive all;
    const SE2 filtered = drive(GetParam(), 7000 + run, all);
    of_filter += error(all.truth.back(), filtered).cwiseAbs2() / kRuns;
    of_batch += error(all.truth.back(), BatchSolution(all).last()).cwiseAbs2() / kRuns;
  }
  const Vector3d ratio = of_filter.cwiseQuotient(of_batch).cwiseSqrt();
  EXPECT_LT(ratio.maxCoeff(), kAtMost) << "x, y, yaw: " << ratio.transpose();
  EXPECT_GT(ratio.minCoeff(), 0.97) << "the batch solution is none: " << ratio.transpose();
  std::cout << GetParam() << ": rms error over that of the batch solution in x, y, yaw: " << ratio.transpose() << "\n";
}

INSTANTIATE_TEST_SUITE_P(Methods, BatchSolutionOf,
                         ::testing::Values(Case{"sckf", 1, 1}, Case{"sckf_multi", 4, 1}, Case{"sckf_multi", 4, 4}));

}  // namespace
}  // namespace sckf
