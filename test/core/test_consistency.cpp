// Whether the covariance can be believed: simulated robots whose scans are shared by the displacements made with them.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <ostream>
#include <string>
#include <tuple>
#include <vector>

#include "core/chi_squared_band.h"
#include "core/random_inputs.h"
#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/core/odometry_model.h"
#include "sckf_odometry/experiments/other_measurements.h"
#include "sckf_odometry/experiments/room_simulation.h"

namespace sckf {
namespace {

constexpr int kRuns = 200;
constexpr int kScans = 60;
constexpr int kIncrementsPerScan = 4;
const std::vector<int> kCheckedScans{10, 20, 30, 40, 50, 60};

/// A place to drive through, and the way through it.
struct World {
  const char* name;
  std::vector<StraightWall> walls;
  int directions;  // that a displacement sees
  SE2 start;       // odom_from_base
  double wave;     // share of the turning that swings left and right rather than going on, 0 to 1
};

//   room, 16 m × 14 m: a circle in it           corridor, 4 m wide: a wavy line along it, which is not seen
//   +------------------+                         ------------------------------------
//   |      .--.        |
//   |     (    )       |                          start >--~~~--~~~--~~~
//   |      '--' start  |
//   +------------------+                         ------------------------------------
const World kRoom{"Room", {{{1, 0}, 8.0}, {{-1, 0}, 8.0}, {{0, 1}, 7.0}, {{0, -1}, 7.0}}, 3, SE2(0.0, -2.5, 0.0), 0.0};
const World kCorridor{"Corridor", {{{0, 1}, 2.0}, {{0, -1}, 2.0}}, 2, SE2(), 1.0};

SE2 motion(const World& world, int increment) {
  const double swing = 1.0 - world.wave + world.wave * std::cos(0.1 * increment);
  return {0.06, 0.0, 0.024 * swing};
}

struct Experiment {
  World world = kRoom;
  int scans_per_reference = 1;
  std::string method = "sckf";
  std::size_t references = 1;   // kept; a scan that becomes a reference is compared with all of them
  double start_std = 1e-3;      // of x, y [m] and yaw [rad]
  double start_yaw_std = 1e-3;  // [rad]
  int pose_set_at = 0;          // scan after which the pose is told anew; 0: never
};

/// Sums over the runs, one entry per scan.
struct Statistics {
  std::vector<double> nees = std::vector<double>(kScans + 1, 0.0);
  std::vector<double> yaw_nees = nees;
  std::vector<double> nis = nees;
  std::vector<double> squared_position_error = nees;  // [m²]

  double rms(int scan) const { return std::sqrt(squared_position_error[scan] / kRuns); }
};

void add(const Eigen::Vector3d& e, const Eigen::Matrix3d& P, double nis, int scan, Statistics& sums) {
  sums.nees[scan] += e.dot(P.llt().solve(e));
  sums.yaw_nees[scan] += e.z() * e.z() / P(2, 2);
  sums.nis[scan] += nis;
  sums.squared_position_error[scan] += e.head<2>().squaredNorm();
}

/// One robot on its way. The wheels' error is drawn from the covariance that the filter is told.
void run(const Experiment& experiment, RandomInputs& random, Statistics& sums) {
  const RoomSimulation room(experiment.world.walls, 0.03);
  const Eigen::Vector3d start_std(experiment.start_std, experiment.start_std, experiment.start_yaw_std);
  const Eigen::Matrix3d P_0 = start_std.cwiseAbs2().asDiagonal();
  SE2 odom_from_base = experiment.world.start;  // the truth
  const auto told = [&](const Eigen::Matrix3d& P) {
    return makeFusionMethod(experiment.method, corrected(odom_from_base, random.drawnFrom(P)), P);
  };
  std::unique_ptr<FusionMethod> filter = told(P_0);
  std::deque<SimulatedScan> references{room.scan(odom_from_base, random)};
  filter->clone(references.front().variance);

  for (int scan = 1; scan <= kScans; ++scan) {
    for (int i = 0; i < kIncrementsPerScan; ++i) {
      const SE2 moved = motion(experiment.world, kIncrementsPerScan * scan + i);
      const Eigen::Matrix3d Q = modelledIncrement(moved, simulatedWheelNoise()).covariance;
      filter->propagate({corrected(moved, random.drawnFrom(Q)), Q});
      odom_from_base = compose(odom_from_base, moved);
    }
    const SimulatedScan current = room.scan(odom_from_base, random);
    const bool pose_set = scan == experiment.pose_set_at;
    const bool new_reference = pose_set || scan % experiment.scans_per_reference == 0;
    double nis = 0.0;
    for (std::size_t i = 0; i < (new_reference ? references.size() : 1); ++i) {
      Displacement z = room.match(references[i], current, random);
      ASSERT_EQ(z.dimension(), experiment.world.directions);
      z.clone = i;
      const Innovation innovation = filter->innovation(z);
      filter->update(z, innovation);
      nis = innovation.nis();  // of the last, which has the others' news behind it
    }
    add(error(odom_from_base, filter->pose()), filter->covariance(), nis, scan, sums);
    if (pose_set) {
      filter = told(Eigen::Vector3d(0.2, 0.1, 0.05).cwiseAbs2().asDiagonal());
      references.clear();
    }
    if (!new_reference) continue;
    filter->clone(current.variance);
    references.push_front(current);
    if (references.size() <= experiment.references) continue;
    references.pop_back();
    if (filter->clones() > references.size()) filter->forget(references.size());
  }
}

Statistics simulate(const Experiment& experiment) {
  Statistics sums;
  for (int i = 0; i < kRuns; ++i) {
    RandomInputs random(1000 + i);  // the same robots for every method
    run(experiment, random, sums);
  }
  return sums;
}

ChiSquaredBand band(int d) { return {d, kRuns}; }

void expectInBand(const std::vector<double>& sums, int d, const std::string& what) {
  std::vector<double> means = sums;
  for (double& mean : means) mean /= kRuns;
  expectInBand(means, band(d), what);
}

class Consistency : public ::testing::TestWithParam<std::tuple<World, int>> {};

/// Names the world in the output of gtest.
void PrintTo(const World& world, std::ostream* os) { *os << world.name; }

TEST_P(Consistency, OfTheErrorsAndOfTheInnovations) {
  Experiment experiment;
  experiment.world = std::get<0>(GetParam());
  experiment.scans_per_reference = std::get<1>(GetParam());
  const Statistics sums = simulate(experiment);
  expectInBand(sums.nees, 3, "NEES");
  expectInBand(sums.nis, experiment.world.directions, "NIS");
}

INSTANTIATE_TEST_SUITE_P(Worlds, Consistency,
                         ::testing::Combine(::testing::Values(kRoom, kCorridor), ::testing::Values(1, 5, 10)),
                         [](const auto& info) {
                           return std::string(std::get<0>(info.param).name) + "References" +
                                  std::to_string(std::get<1>(info.param));
                         });

/// A pose that is set drops the clone and all that is correlated with it. The scan after becomes the reference.
TEST(PoseSetInMidRun, LeavesErrorsAndInnovationsConsistent) {
  for (const auto& [method, scans_per_reference] : {std::pair("sckf", 1), {"sckf", 5}, {"sckf_multi", 5}}) {
    SCOPED_TRACE(std::string(method) + ", " + std::to_string(scans_per_reference));
    Experiment experiment;
    experiment.method = method;
    experiment.references = experiment.method == "sckf_multi" ? 4 : 1;
    experiment.scans_per_reference = scans_per_reference;
    experiment.pose_set_at = 23;
    const Statistics sums = simulate(experiment);
    expectInBand(sums.nees, 3, "NEES");
    expectInBand(sums.nis, 3, "NIS");
  }
}

class SeveralReferences : public ::testing::TestWithParam<std::tuple<World, int>> {};

TEST_P(SeveralReferences, AreConsistentToo) {
  Experiment experiment;
  experiment.method = "sckf_multi";
  experiment.world = std::get<0>(GetParam());
  experiment.references = 4;
  experiment.scans_per_reference = std::get<1>(GetParam());
  const Statistics sums = simulate(experiment);
  expectInBand(sums.nees, 3, "NEES");
  expectInBand(sums.nis, experiment.world.directions, "NIS");
}

INSTANTIATE_TEST_SUITE_P(Worlds, SeveralReferences,
                         ::testing::Combine(::testing::Values(kRoom, kCorridor), ::testing::Values(1, 5)),
                         [](const auto& info) {
                           return std::string(std::get<0>(info.param).name) + "References" +
                                  std::to_string(std::get<1>(info.param));
                         });

TEST(SeveralReferences, AreMoreAccurateThanOne) {
  Experiment experiment;
  const Statistics one = simulate(experiment);
  experiment.method = "sckf_multi";
  experiment.references = 4;
  const Statistics several = simulate(experiment);
  EXPECT_LT(several.rms(kScans), 0.9 * one.rms(kScans));
}

class HardlyKnownYaw : public ::testing::TestWithParam<const char*> {};

TEST_P(HardlyKnownYaw, StaysHardlyKnown) {
  // Displacements say nothing about the absolute yaw, however much the estimate moves while a reference is kept.
  Experiment experiment;
  experiment.method = GetParam();
  experiment.references = experiment.method == "sckf_multi" ? 4 : 1;
  experiment.scans_per_reference = 10;
  experiment.start_yaw_std = 0.3;
  expectInBand(simulate(experiment).yaw_nees, 1, "NEES of the yaw");
}

INSTANTIATE_TEST_SUITE_P(Methods, HardlyKnownYaw, ::testing::Values("sckf", "sckf_multi"),
                         [](const auto& info) { return std::string(info.param); });

TEST(WithoutCorrelations, IsFarTooPessimistic) {
  Experiment experiment;
  const Statistics with = simulate(experiment);
  experiment.method = "sckf_nc";
  const Statistics without = simulate(experiment);
  for (const int scan : kCheckedScans) {
    EXPECT_LT(without.nees[scan] / kRuns, 0.6 * band(3).low) << "scan " << scan << ": pessimistic, by far";
    EXPECT_LE(with.rms(scan), without.rms(scan)) << "scan " << scan;
  }
}

TEST(RoomSimulation, MakesConsecutiveDisplacementsNegativelyCorrelated) {
  RandomInputs random(3);
  const RoomSimulation room(kRoom.walls, 0.03);
  const SE2 step(0.2, 0.0, 0.0);
  const SimulatedScan first = room.scan(kRoom.start, random);
  const SimulatedScan second = room.scan(compose(first.odom_from_base, step), random);
  const SimulatedScan third = room.scan(compose(second.odom_from_base, step), random);
  const Displacement before = room.match(first, second, random);
  const Displacement after = room.match(second, third, random);
  const Eigen::Matrix3d cross = before.observable.transpose() * before.J_current * second.variance.asDiagonal() *
                                after.J_reference.transpose() * after.observable;
  const Eigen::Matrix3d whole = before.observable.transpose() * before.covariance() * before.observable;
  for (int i = 0; i < 3; ++i) EXPECT_LT(cross(i, i), -0.25 * whole(i, i)) << "of x, y, yaw, number " << i;
}

}  // namespace
}  // namespace sckf
