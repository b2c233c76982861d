// Two lasers on one robot, each with clones and range noise of its own: whether the covariance can be believed.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <deque>
#include <vector>

#include "chi_squared_band.h"
#include "room_simulation.h"
#include "sckf_odometry/core/multi_clone_filter.h"
#include "sckf_odometry/core/odometry_model.h"

namespace sckf {
namespace {

constexpr int kRuns = 200;
constexpr int kTicks = 80;
const std::vector<Wall> kRoom{{{1, 0}, 8.0}, {{-1, 0}, 8.0}, {{0, 1}, 7.0}, {{0, -1}, 7.0}};

struct Laser {
  RoomSimulation room;
  int every;         // so many ticks there is a scan …
  int until;         // … before this one
  int reference;     // every so many scans become a reference
  std::size_t kept;  // references
};

struct Result {
  std::vector<double> nees = std::vector<double>(kTicks + 1, 0.0);
  double squared_error = 0.0;  // [m²] at the end
};

/// The scan of each clone of the filter, the newest first, and whose it is.
struct Reference {
  std::size_t laser;
  SimulatedScan scan;
};

void drive(const std::vector<Laser>& lasers, RandomInputs& random, Result& result) {
  const Eigen::Matrix3d P_0 = 1e-6 * Eigen::Matrix3d::Identity();
  SE2 truth(0.0, -2.5, 0.0);
  MultiCloneFilter filter(corrected(truth, random.drawnFrom(P_0)), P_0);
  std::deque<Reference> references;
  std::vector<int> scans(lasers.size(), 0);
  for (int tick = 0; tick <= kTicks; ++tick) {
    for (std::size_t i = 0; i < lasers.size(); ++i) {  // at one instant, one after the other
      if (tick % lasers[i].every != 0 || tick >= lasers[i].until) continue;
      filter.beginScan();
      const SimulatedScan current = lasers[i].room.scan(truth, random);
      const bool new_reference = scans[i]++ % lasers[i].reference == 0;
      std::size_t compared = 0;
      for (std::size_t clone = 0; clone < references.size(); ++clone) {
        if (references[clone].laser != i || (compared++ > 0 && !new_reference)) continue;
        Displacement z = lasers[i].room.match(references[clone].scan, current, random);
        z.clone = clone;
        filter.update(z, filter.innovation(z));
      }
      if (!new_reference) continue;
      filter.clone(current.variance);
      references.push_front({i, current});
      if (compared < lasers[i].kept) continue;
      for (std::size_t clone = references.size(); clone-- > 0;) {
        if (references[clone].laser != i) continue;
        filter.forget(clone);
        references.erase(references.begin() + static_cast<std::ptrdiff_t>(clone));
        break;
      }
    }
    const Eigen::Vector3d e = error(truth, filter.pose());
    result.nees[static_cast<std::size_t>(tick)] += e.dot(filter.covariance().llt().solve(e)) / kRuns;
    if (tick == kTicks) result.squared_error += e.head<2>().squaredNorm() / kRuns;
    const SE2 moved(0.06, 0.0, 0.024);
    OdometryNoise noise;
    noise.translation_per_meter = noise.yaw_per_meter = 0.05;
    const Eigen::Matrix3d Q = modelledIncrement(moved, noise).covariance;
    filter.propagate({corrected(moved, random.drawnFrom(Q)), Q});
    truth = compose(truth, moved);
  }
}

Result simulate(const std::vector<Laser>& lasers) {
  Result result;
  for (int i = 0; i < kRuns; ++i) {
    RandomInputs random(3000U + static_cast<std::uint64_t>(i));
    drive(lasers, random, result);
  }
  return result;
}

const Laser kFast{RoomSimulation(kRoom, 0.03), 1, kTicks + 1, 4, 3};
const Laser kSlow{RoomSimulation(kRoom, 0.01), 8, kTicks + 1, 1, 2};  // 40 Hz and 5 Hz, and precise

TEST(SeveralLasers, AreConsistent) {
  expectInBand(simulate({kFast, kSlow}).nees, ChiSquaredBand(3, kRuns), "NEES");
  expectInBand(simulate({kSlow, kFast, kFast}).nees, ChiSquaredBand(3, kRuns), "NEES of three");
}

TEST(SeveralLasers, OneThatFailsLeavesTheOthers) {
  Laser dies = kSlow;
  dies.until = 30;
  const Result with = simulate({kFast, dies});
  expectInBand(with.nees, ChiSquaredBand(3, kRuns), "NEES");
}

TEST(SeveralLasers, AreMoreAccurateThanEach) {
  const double both = simulate({kFast, kSlow}).squared_error;
  EXPECT_LT(both, 0.8 * simulate({kFast}).squared_error);
  EXPECT_LT(both, 0.9 * simulate({kSlow}).squared_error);
}

}  // namespace
}  // namespace sckf
