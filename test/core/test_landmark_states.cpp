// Landmarks in the state: hand values, what they must never learn, and whether the covariance can be believed.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <deque>
#include <string>
#include <vector>

#include "matrix_matchers.h"
#include "random_inputs.h"
#include "sckf_odometry/core/multi_clone_filter.h"
#include "sckf_odometry/core/odometry_model.h"
#include "sckf_odometry/experiments/room_simulation.h"

namespace sckf {
namespace {

using Eigen::Matrix3d;

Matrix3d diagonal(double x, double y, double yaw) { return Eigen::Vector3d(x, y, yaw).cwiseAbs2().asDiagonal(); }

// The robot looks along y and sees a landmark 2 m ahead, turned to the left.
//
//        L ⟵         y
//                     |
//        ↑ robot      +-- x
//
TEST(LandmarkStates, ALandmarkIsWhereItIsSeen) {
  MultiCloneFilter filter(SE2(10.0, 5.0, M_PI_2), diagonal(0.0, 0.0, 0.0));
  filter.addLandmark({SE2(2.0, 0.0, M_PI_2), diagonal(0.1, 0.2, 0.3)});
  ASSERT_EQ(filter.landmarks(), 1U);
  EXPECT_LT(error(filter.landmark(0), SE2(10.0, 7.0, M_PI)).norm(), 1e-12);
  // Ahead of the robot is along y.
  EXPECT_TRUE(matricesNear(filter.landmarkCovariance(0), diagonal(0.2, 0.1, 0.3), 1e-12));
}

TEST(LandmarkStates, AYawThatIsNotKnownIsALeverToTheLandmark) {
  MultiCloneFilter filter(SE2(10.0, 5.0, 0.0), diagonal(0.1, 0.1, 0.2));
  filter.addLandmark({SE2(3.0, 0.0, 0.0), Matrix3d::Zero()});
  const Matrix3d P = filter.landmarkCovariance(0);
  EXPECT_NEAR(P(0, 0), 0.01, 1e-12);
  EXPECT_NEAR(P(1, 1), 0.01 + 9.0 * 0.04, 1e-12);
  EXPECT_NEAR(P(1, 2), 3.0 * 0.04, 1e-12);
}

/// From where it was begun a landmark is known as well as it was seen; seen a second time it is as good as two.
TEST(LandmarkStates, TheInnovationIsOfBothSightings) {
  MultiCloneFilter filter(SE2(3.0, 1.0, 0.4), diagonal(1.0, 1.0, 0.5));
  const Sighting seen{SE2(2.0, 1.0, 0.3), diagonal(0.1, 0.2, 0.05)};
  filter.addLandmark(seen);
  const Sighting again{corrected(seen.base_from_landmark, Eigen::Vector3d(0.1, 0.0, 0.0)), seen.covariance};
  const Innovation r = filter.innovation(0, again);
  EXPECT_TRUE(matricesNear(r.residual, Eigen::Vector3d(0.1, 0.0, 0.0), 1e-12));
  EXPECT_TRUE(matricesNear(r.covariance, 2.0 * seen.covariance, 1e-12));
  EXPECT_NEAR(r.nis(), 0.5, 1e-9);
  filter.update(0, again);
  const SE2 expected = between(filter.pose(), filter.landmark(0));
  EXPECT_NEAR(expected.x, 2.05, 1e-3) << "halfway";
  EXPECT_TRUE(matricesNear(filter.innovation(0, again).covariance, 1.5 * seen.covariance, 1e-3));
}

TEST(LandmarkStates, ThoseAfterAForgottenOneMoveUp) {
  MultiCloneFilter filter(SE2(), diagonal(0.1, 0.1, 0.1));
  for (const double x : {1.0, 2.0, 3.0}) filter.addLandmark({SE2(x, 0.0, 0.0), diagonal(0.1, 0.1, 0.1)});
  filter.forgetLandmark(1);
  ASSERT_EQ(filter.landmarks(), 2U);
  EXPECT_NEAR(filter.landmark(0).x, 1.0, 1e-12);
  EXPECT_NEAR(filter.landmark(1).x, 3.0, 1e-12);
  // The place of the forgotten one is as good as new.
  filter.addLandmark({SE2(4.0, 0.0, 0.0), Matrix3d::Zero()});
  EXPECT_NEAR(filter.landmarkCovariance(2)(0, 0), 0.01, 1e-12);
}

TEST(LandmarkStates, NobodyLearnsWhereTheWholeIs) {
  // As MultiCloneFilter.NeverLearnsWhereTheWholeIs: estimates move with each noisy update, and none is a compass.
  RandomInputs random(183);
  MultiCloneFilter filter(SE2(), Eigen::Vector3d(1.0, 1.0, 0.09).asDiagonal());
  const Eigen::VectorXd R = Eigen::VectorXd::Constant(4, 1e-3);
  for (int scan = 0; scan < 500; ++scan) {
    filter.propagate({SE2(0.3, 0.02, 0.05), random.covariance(3, 0.1)});
    if (scan > 0) {
      const Displacement z = random.displacement(filter.predictedDisplacement().reference_from_current, 3, R, R, 0.02);
      filter.update(z, filter.innovation(z));
    }
    for (std::size_t i = 0; i < filter.landmarks(); ++i) {
      const SE2 expected = between(filter.pose(), filter.landmark(i));
      const Eigen::Vector3d off(0.05 * random.gaussian(3));
      filter.update(i, {corrected(expected, off), random.covariance(3, 0.05)});
    }
    if (scan % 10 == 0) filter.addLandmark({random.pose(5.0), random.covariance(3, 0.05)});
    if (filter.landmarks() > 5) filter.forgetLandmark(0);
    filter.clone(R);
    if (filter.clones() > 3) filter.forget(3);
    ASSERT_GE(filter.covariance()(2, 2), 0.09 * (1.0 - 1e-6)) << "yaw variance at scan " << scan;
  }
}

TEST(LandmarkStates, AnotherWorldLeavesThemWhereTheRobotSeesThem) {
  MultiCloneFilter filter(SE2(1.0, 2.0, 0.3), diagonal(0.1, 0.1, 0.1));
  const Sighting seen{SE2(2.0, 1.0, 0.3), diagonal(0.1, 0.2, 0.05)};
  filter.addLandmark(seen);
  const Matrix3d before = filter.innovation(0, seen).covariance;
  filter.enterWorld({SE2(400.0, -300.0, 2.5), diagonal(0.01, 0.01, 0.01)});
  EXPECT_NEAR(filter.pose().x, 400.0, 1e-3);
  EXPECT_LT(error(between(filter.pose(), filter.landmark(0)), seen.base_from_landmark).norm(), 1e-6);
  EXPECT_TRUE(matricesNear(filter.innovation(0, seen).covariance, before, 1e-6));
}

// ---- consistency

constexpr int kRuns = 200;
constexpr int kScans = 40;

struct Statistics {
  std::vector<double> pose = std::vector<double>(kScans + 1, 0.0);
  std::vector<double> landmark = pose;       // where it is in base_link
  std::vector<double> squared_error = pose;  // [m²]
};

/// A robot in a room without features along x, but for landmarks here and there that it sees from up to 4 m.
class Robot {
 public:
  Robot(bool displacements, bool landmarks, std::uint64_t seed)
      : displacements_(displacements),
        landmarks_(landmarks),
        random_(seed),
        room_({{{0, 1}, 3.0}, {{0, -1}, 3.0}, {{1, 0}, 9.0}, {{-1, 0}, 9.0}}, 0.06),
        filter_(corrected(truth_, random_.drawnFrom(kStart)), kStart) {
    for (double x = -8.0; x < 9.0; x += 2.0) {
      places_.push_back({x, 2.5, random_.uniform(-3.0, 3.0)});
      places_.push_back({x + 1.0, -2.5, random_.uniform(-3.0, 3.0)});
    }
    reference_ = room_.scan(truth_, random_);
    filter_.clone(reference_.variance);
  }

  void run(Statistics& sums) {
    for (int scan = 1; scan <= kScans; ++scan) {
      for (int i = 0; i < 3; ++i) drive(SE2(0.08, 0.0, 0.05 * std::cos(0.1 * (3 * scan + i))));
      const SimulatedScan current = room_.scan(truth_, random_);
      if (displacements_) {
        const Displacement z = room_.match(reference_, current, random_);
        filter_.update(z, filter_.innovation(z));
      }
      if (landmarks_) see();
      if (displacements_ && scan % 2 == 0) {
        filter_.clone(current.variance);
        reference_ = current;
        if (filter_.clones() > 2) filter_.forget(2);
      }
      note(static_cast<std::size_t>(scan), sums);
    }
  }

 private:
  void drive(const SE2& by_wheels) {
    OdometryNoise noise;
    noise.translation_per_meter = noise.translation_per_radian = 0.05;
    noise.yaw_per_meter = noise.yaw_per_radian = 0.08;
    const OdometryIncrement increment = modelledIncrement(by_wheels, noise);
    filter_.propagate(increment);
    truth_ = compose(truth_, corrected(by_wheels, random_.drawnFrom(increment.covariance)));
  }

  void see() {
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const SE2 truth = between(truth_, places_[i]);
      const Matrix3d R = random_.covariance(3, 0.02);
      const Sighting z{corrected(truth, random_.drawnFrom(R)), R};
      if (truth.translation().norm() > 4.0) continue;
      const auto known = std::find(known_.begin(), known_.end(), i);
      if (known != known_.end()) {
        filter_.update(static_cast<std::size_t>(known - known_.begin()), z);
        continue;
      }
      filter_.addLandmark(z);
      known_.push_back(i);
      if (known_.size() <= 6) continue;  // the oldest is given up
      filter_.forgetLandmark(0);
      known_.pop_front();
    }
  }

  void note(std::size_t scan, Statistics& sums) const {
    const Eigen::Vector3d e = error(truth_, filter_.pose());
    sums.pose[scan] += e.dot(filter_.covariance().llt().solve(e)) / kRuns;
    sums.squared_error[scan] += e.head<2>().squaredNorm() / kRuns;
    if (known_.empty()) return;
    const Sighting truth{between(truth_, places_[known_.back()]), Matrix3d::Zero()};
    sums.landmark[scan] += filter_.innovation(known_.size() - 1, truth).nis() / kRuns;
  }

  static inline const Matrix3d kStart = 1e-6 * Matrix3d::Identity();

  bool displacements_;
  bool landmarks_;
  RandomInputs random_;
  RoomSimulation room_;
  SE2 truth_{-6.0, 0.0, 0.0};
  MultiCloneFilter filter_;
  SimulatedScan reference_;
  std::vector<SE2> places_;
  std::deque<std::size_t> known_;  // place of each landmark
};

Statistics simulate(bool displacements, bool landmarks) {
  Statistics sums;
  for (int i = 0; i < kRuns; ++i) {
    Robot(displacements, landmarks, 3000U + static_cast<std::uint64_t>(i)).run(sums);
  }
  return sums;
}

/// Where the mean over the runs of a χ² with three degrees of freedom lies, but for once in a thousand times.
void expectInBand(const std::vector<double>& means, const std::string& what) {
  const boost::math::chi_squared sum(static_cast<double>(kRuns * 3));
  for (std::size_t scan = 10; scan <= kScans; scan += 10) {
    EXPECT_GT(means[scan], boost::math::quantile(sum, 0.0005) / kRuns) << what << " at scan " << scan << ": too large";
    EXPECT_LT(means[scan], boost::math::quantile(sum, 0.9995) / kRuns) << what << " at scan " << scan << ": too small";
  }
}

TEST(LandmarkStates, ConsistentAloneAndBesideDisplacementsWhichTogetherAreTheBest) {
  const Statistics alone = simulate(false, true);
  expectInBand(alone.pose, "pose, landmarks alone");
  expectInBand(alone.landmark, "landmark, landmarks alone");
  const Statistics displacements = simulate(true, false);
  const Statistics both = simulate(true, true);
  expectInBand(both.pose, "pose, both");
  expectInBand(both.landmark, "landmark, both");
  EXPECT_LT(both.squared_error[kScans], 0.9 * alone.squared_error[kScans]);
  EXPECT_LT(both.squared_error[kScans], 0.9 * displacements.squared_error[kScans]);
}

}  // namespace
}  // namespace sckf
