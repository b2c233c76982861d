// The covariance of parts that come and go: against one matrix of everything, on which every step is written out.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <map>
#include <string>
#include <vector>

#include "core/matrix_matchers.h"
#include "core/random_inputs.h"
#include "sckf_odometry/core/error_state.h"

namespace sckf {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Part = ErrorState::Part;
using Measurement = ErrorState::Measurement;

/// x̆ ← A x̆ for everything that there is, parts and ranges alike, in the order of their coming.
class Everything {
 public:
  struct Rows {
    Index first, size;
  };

  Rows add(const MatrixXd& covariance) {
    const Rows rows{P_.rows(), covariance.rows()};
    MatrixXd larger = MatrixXd::Zero(rows.first + rows.size, rows.first + rows.size);
    larger.topLeftCorner(rows.first, rows.first) = P_;
    larger.bottomRightCorner(rows.size, rows.size) = covariance;
    P_ = larger;
    return rows;
  }

  /// rows ← rows + B by
  void move(Rows rows, const MatrixXd& B, Rows by) {
    MatrixXd A = MatrixXd::Identity(P_.rows(), P_.rows());
    A.block(rows.first, by.first, rows.size, by.size) += B;
    P_ = A * P_ * A.transpose();
  }

  void disturb(Rows rows, const MatrixXd& Q) { P_.block(rows.first, rows.first, rows.size, rows.size) += Q; }

  /// H of everything; the best K.
  MatrixXd gain(const MatrixXd& H, const MatrixXd& noise) const {
    const MatrixXd S = H * P_ * H.transpose() + noise;
    return P_ * H.transpose() * S.inverse();
  }

  void update(const MatrixXd& H, const MatrixXd& noise, const MatrixXd& K) {
    const MatrixXd I_KH = MatrixXd::Identity(P_.rows(), P_.rows()) - K * H;
    P_ = I_KH * P_ * I_KH.transpose() + K * noise * K.transpose();
  }

  MatrixXd block(Rows a, Rows b) const { return P_.block(a.first, b.first, a.size, b.size); }
  Index size() const { return P_.rows(); }

 private:
  MatrixXd P_;
};

/// The same steps in both.
class ErrorStateTest : public testing::Test {
 protected:
  struct Named {
    Part part;
    Everything::Rows rows;
  };
  struct Scan {
    ErrorState::Ranges ranges;
    Everything::Rows rows;
  };

  void add() {
    const MatrixXd P = random_.covariance(random_.integer(1, 3), 1.0);
    parts_.push_back({state_.add(P), all_.add(P)});
  }

  void addClone() {
    const Named original = any();
    const Index size = original.part.size;
    const Named clone{state_.addCloneOf(original.part), all_.add(MatrixXd::Zero(size, size))};
    all_.move(clone.rows, MatrixXd::Identity(size, size), original.rows);
    parts_.push_back(clone);
  }

  void addScan() {
    const Eigen::VectorXd variances = random_.rangeVariances(random_.integer(1, 6), 0.1, 1.0);
    scans_.push_back({state_.addRanges(variances), all_.add(variances.asDiagonal())});
  }

  void move() {
    moveBy(any(), any());
    const Named one = any();
    moveBy(one, one);
  }

  void moveBy(const Named& to, const Named& by) {
    const MatrixXd B = 0.5 * random_.gaussian(to.part.size, by.part.size);
    state_.move(to.part, B, by.part);
    all_.move(to.rows, B, by.rows);
    const MatrixXd Q = random_.covariance(to.part.size, 0.3);
    state_.disturb(to.part, Q);
    all_.disturb(to.rows, Q);
  }

  void update() {
    const int d = random_.integer(1, 3);
    Measurement m;
    m.residual = random_.gaussian(d);
    m.noise = random_.covariance(d, 0.5);
    MatrixXd H = MatrixXd::Zero(d, all_.size());
    std::vector<Named> corrected;
    for (const Named& named : parts_) {
      if (random_.uniform(0.0, 1.0) < 0.5) {
        m.terms.push_back({named.part, random_.gaussian(d, named.part.size)});
        H.middleCols(named.rows.first, named.rows.size) = m.terms.back().H;
      }
      if (random_.uniform(0.0, 1.0) < 0.5) corrected.push_back(named);
    }
    for (const Scan& scan : scans_) {
      if (random_.uniform(0.0, 1.0) < 0.5) continue;
      m.ranges.push_back({scan.ranges, random_.gaussian(d, scan.rows.size)});
      H.middleCols(scan.rows.first, scan.rows.size) = m.ranges.back().J;
    }
    const ErrorState::Correlation with_r = state_.correlate(m);
    const MatrixXd best = all_.gain(H, m.noise);
    MatrixXd K = MatrixXd::Zero(all_.size(), d);
    std::vector<ErrorState::Gain> gains;
    for (const auto& [part, rows] : corrected) {
      EXPECT_TRUE(matricesNear(with_r.gain(part), best.middleRows(rows.first, rows.size), 1e-8));
      gains.push_back({part, with_r.gain(part)});
      if (random_.uniform(0.0, 1.0) < 0.5) gains.back().K += 0.1 * random_.gaussian(rows.size, d);  // any may be taken
      K.middleRows(rows.first, rows.size) = gains.back().K;
    }
    state_.update(m, with_r, gains);
    all_.update(H, m.noise, K);
  }

  void forget() {
    const auto gone = parts_.begin() + random_.integer(0, static_cast<int>(parts_.size()) - 1);
    state_.remove(gone->part);
    parts_.erase(gone);
    if (scans_.size() < 3) return;  // some stay, which are correlated with what moves
    state_.removeRanges(scans_.front().ranges);
    scans_.erase(scans_.begin());
  }

  void compare() const {
    for (const Named& a : parts_) {
      for (const Named& b : parts_) {
        EXPECT_TRUE(matricesNear(state_.covariance(a.part, b.part), all_.block(a.rows, b.rows), 1e-12));
      }
      for (const Scan& scan : scans_) {  // by what an innovation sees of both
        Measurement m;
        m.residual = Eigen::VectorXd::Zero(1);
        m.noise = MatrixXd::Zero(1, 1);
        m.ranges.push_back({scan.ranges, MatrixXd::Ones(1, scan.rows.size)});
        const MatrixXd seen = state_.correlate(m).state.middleRows(a.part.row, a.part.size);
        EXPECT_TRUE(matricesNear(seen, all_.block(a.rows, scan.rows).rowwise().sum(), 1e-7));
      }
    }
  }

  const Named& any() {
    return parts_[static_cast<std::size_t>(random_.integer(0, static_cast<int>(parts_.size()) - 1))];
  }

  RandomInputs random_{91};
  ErrorState state_;
  Everything all_;
  std::vector<Named> parts_;
  std::vector<Scan> scans_;
};

TEST_F(ErrorStateTest, IsTheWholeMatrixWhateverComesAndGoes) {
  for (int step = 0; step < 50 && !HasFailure(); ++step) {
    SCOPED_TRACE("step " + std::to_string(step));
    while (parts_.size() < 4) add();
    addClone();
    if (step % 2 == 0) addScan();
    move();
    update();
    compare();
    forget();
    forget();
  }
}

TEST_F(ErrorStateTest, TakesTheRowsOfWhatIsGone) {
  const Part first = state_.add(MatrixXd::Identity(3, 3));
  const Part other = state_.add(MatrixXd::Identity(2, 2));
  const Part clone = state_.addCloneOf(first);
  state_.remove(clone);
  const Part again = state_.add(2.0 * MatrixXd::Identity(3, 3));
  EXPECT_EQ(again.row, clone.row) << "or memory would grow with the way";
  EXPECT_TRUE(matricesNear(state_.covariance(again, first), MatrixXd::Zero(3, 3), 0.0));
  EXPECT_TRUE(matricesNear(state_.covariance(again), 2.0 * MatrixXd::Identity(3, 3), 0.0));
  EXPECT_TRUE(matricesNear(state_.covariance(other), MatrixXd::Identity(2, 2), 0.0));
}

}  // namespace
}  // namespace sckf
