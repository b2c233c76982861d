#include "sckf_odometry/experiments/several_lasers.h"

#include <deque>

#include "sckf_odometry/core/multi_clone_filter.h"
#include "sckf_odometry/core/odometry_model.h"
#include "sckf_odometry/experiments/pose_nees.h"

namespace sckf {

namespace {

/// The scan of each clone of the filter, the newest first, and whose it is.
struct Reference {
  std::size_t laser;
  SimulatedScan scan;
};

class Robot {
 public:
  Robot(const std::vector<SimulatedLaserRate>& lasers, std::uint64_t seed)
      : lasers_(lasers), random_(seed), filter_(corrected(truth_, random_.drawnFrom(kStart)), kStart) {}

  void look(int tick) {
    for (std::size_t i = 0; i < lasers_.size(); ++i) {  // at one instant, one after the other
      if (tick % lasers_[i].every == 0 && tick < lasers_[i].until) take(i);
    }
  }

  void drive() {
    const SE2 moved(0.06, 0.0, 0.024);
    OdometryNoise noise;
    noise.translation_per_meter = noise.yaw_per_meter = 0.05;
    const Eigen::Matrix3d Q = modelledIncrement(moved, noise).covariance;
    filter_.propagate({corrected(moved, random_.drawnFrom(Q)), Q});
    truth_ = compose(truth_, moved);
  }

  void note(std::size_t tick, int runs, SeveralLasersStatistics& sums) const {
    sums.nees[tick] += poseNees(truth_, filter_.pose(), filter_.covariance()) / runs;
    sums.squared_error[tick] += (truth_.translation() - filter_.pose().translation()).squaredNorm() / runs;
  }

 private:
  void take(std::size_t laser) {
    filter_.beginScan();
    const SimulatedScan current = lasers_[laser].room.scan(truth_, random_);
    const bool new_reference = scans_[laser]++ % lasers_[laser].reference == 0;
    std::size_t compared = 0;
    for (std::size_t clone = 0; clone < references_.size(); ++clone) {
      if (references_[clone].laser != laser || (compared++ > 0 && !new_reference)) continue;
      Displacement z = lasers_[laser].room.match(references_[clone].scan, current, random_);
      z.clone = clone;
      filter_.update(z, filter_.innovation(z));
    }
    if (!new_reference) return;
    filter_.clone(current.variance);
    references_.push_front({laser, current});
    if (compared >= lasers_[laser].kept) forgetOldestOf(laser);
  }

  void forgetOldestOf(std::size_t laser) {
    std::size_t clone = references_.size() - 1;
    while (references_[clone].laser != laser) --clone;
    filter_.forget(clone);
    references_.erase(references_.begin() + static_cast<std::ptrdiff_t>(clone));
  }

  static inline const Eigen::Matrix3d kStart = 1e-6 * Eigen::Matrix3d::Identity();

  const std::vector<SimulatedLaserRate>& lasers_;
  RandomDraws random_;
  SE2 truth_{0.0, -2.5, 0.0};
  MultiCloneFilter filter_;
  std::deque<Reference> references_;
  std::vector<int> scans_ = std::vector<int>(lasers_.size(), 0);
};

}  // namespace

SimulatedLaserRate fastLaser() { return {RoomSimulation(simulatedHall(), 0.03), 1, 4, 3}; }

SimulatedLaserRate slowLaser() { return {RoomSimulation(simulatedHall(), 0.01), 8, 1, 2}; }

SeveralLasersStatistics simulateSeveralLasers(const std::vector<SimulatedLaserRate>& lasers,
                                              const SeveralLasersOptions& options) {
  const std::vector<double> none(static_cast<std::size_t>(options.ticks) + 1, 0.0);
  SeveralLasersStatistics sums{none, none};
  for (int run = 0; run < options.runs; ++run) {
    Robot robot(lasers, options.seed + static_cast<std::uint64_t>(run));
    for (int tick = 0; tick <= options.ticks; ++tick) {
      robot.look(tick);
      robot.note(static_cast<std::size_t>(tick), options.runs, sums);
      robot.drive();
    }
  }
  return sums;
}

}  // namespace sckf
