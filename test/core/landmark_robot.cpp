#include "core/landmark_robot.h"

#include <algorithm>
#include <cmath>
#include <deque>

#include "core/chi_squared_band.h"
#include "sckf_odometry/core/multi_clone_filter.h"
#include "sckf_odometry/core/odometry_model.h"
#include "sckf_odometry/experiments/pose_nees.h"
#include "sckf_odometry/experiments/room_simulation.h"

namespace sckf {

namespace {

constexpr int kRuns = 200;
constexpr int kScans = 40;

struct Statistics {
  std::vector<double> pose = std::vector<double>(kScans + 1, 0.0);
  std::vector<double> landmark = pose;       // what is seen of one in base_link
  std::vector<double> squared_error = pose;  // [m²]
};

/// A robot in a room without features along x, but for landmarks here and there that it sees from up to 4 m.
class LandmarkRobot {
 public:
  LandmarkRobot(const LandmarkWorld& world, bool displacements, bool landmarks, std::uint64_t seed)
      : world_(world),
        displacements_(displacements),
        landmarks_(landmarks),
        random_(seed),
        room_({{{0, 1}, 3.0}, {{0, -1}, 3.0}, {{1, 0}, 9.0}, {{-1, 0}, 9.0}}, 0.06),
        filter_(corrected(truth_, random_.drawnFrom(kStart)), kStart),
        places_(world.places(random_)),
        reference_(room_.scan(truth_, random_)) {
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
      if (between(truth_, places_[i]).translation().norm() > 4.0) continue;
      const Sighting z = world_.seen(truth_, places_[i], random_);
      const auto known = std::find(known_.begin(), known_.end(), i);
      if (known != known_.end()) {
        filter_.update(static_cast<std::size_t>(known - known_.begin()), z);
        continue;
      }
      filter_.addLandmark(z);
      known_.push_back(i);
      if (known_.size() <= world_.most) continue;
      filter_.forgetLandmark(0);
      known_.pop_front();
    }
  }

  void note(std::size_t scan, Statistics& sums) const {
    sums.pose[scan] += poseNees(truth_, filter_.pose(), filter_.covariance()) / kRuns;
    sums.squared_error[scan] += (truth_.translation() - filter_.pose().translation()).squaredNorm() / kRuns;
    if (known_.empty()) return;
    const Sighting truth = world_.exact(between(truth_, places_[known_.back()]));
    sums.landmark[scan] += filter_.innovation(known_.size() - 1, truth).nis() / kRuns;
  }

  static inline const Eigen::Matrix3d kStart = 1e-6 * Eigen::Matrix3d::Identity();

  const LandmarkWorld& world_;
  bool displacements_;
  bool landmarks_;
  RandomInputs random_;
  RoomSimulation room_;
  SE2 truth_{-6.0, 0.0, 0.0};
  MultiCloneFilter filter_;
  std::vector<SE2> places_;
  SimulatedScan reference_;
  std::deque<std::size_t> known_;  // place of each landmark
};

Statistics simulate(const LandmarkWorld& world, bool displacements, bool landmarks) {
  Statistics sums;
  for (int i = 0; i < kRuns; ++i) {
    LandmarkRobot(world, displacements, landmarks, world.seed + static_cast<std::uint64_t>(i)).run(sums);
  }
  return sums;
}

}  // namespace

void expectConsistentAndBestTogether(const LandmarkWorld& world) {
  const ChiSquaredBand of_pose(3, kRuns);
  const ChiSquaredBand of_landmark(world.degrees_of_freedom, kRuns);
  const Statistics alone = simulate(world, false, true);
  expectInBand(alone.pose, of_pose, "pose, landmarks alone");
  expectInBand(alone.landmark, of_landmark, "landmark, landmarks alone");
  const Statistics displacements = simulate(world, true, false);
  const Statistics both = simulate(world, true, true);
  expectInBand(both.pose, of_pose, "pose, both");
  expectInBand(both.landmark, of_landmark, "landmark, both");
  EXPECT_LT(both.squared_error[kScans], 0.9 * alone.squared_error[kScans]);
  EXPECT_LT(both.squared_error[kScans], 0.9 * displacements.squared_error[kScans]);
}

}  // namespace sckf
