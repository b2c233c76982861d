// Corners as landmarks, through the whole way of a scan: what uses which range, which corner is which landmark, how
// many there are, and a loop.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <set>
#include <stdexcept>

#include "pipeline/simulated_drive.h"

namespace sckf::test {
namespace {

using ::testing::HasSubstr;

PipelineOptions with(const std::string& landmarks) {
  PipelineOptions options;
  options.landmarks.use = landmarks;
  return options;
}

/// Beams of a scan of the pipeline that are in no match.
std::set<int> setAsideBeams(const PreparedScan& scan) {
  std::set<int> beams;
  for (int beam = 0; beam < static_cast<int>(scan.beams); ++beam) beams.insert(beam);
  for (const int beam : scan.points.beam) beams.erase(beam);
  return beams;
}

// ---- what uses which range

class LandmarksOfEachKind : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Landmarks, LandmarksOfEachKind, ::testing::Values("corners", "lines", "corners_and_lines"));

TEST_P(LandmarksOfEachKind, NoRangeOfALandmarkHasAPartInADisplacementNotEvenAsAReference) {
  const SimulatedDrive drive;
  Driven driven(drive, with(GetParam()));
  driven.odometry(0);
  driven.run(0, 16000);
  std::map<Stamp, std::set<int>> set_aside;
  int used = 0;
  int references_with_landmarks = 0;
  for (const ScanReport& report : driven.reports) {
    ASSERT_NE(report.scan, nullptr);
    EXPECT_EQ(report.scan->size() + report.scan->set_aside.size(), report.scan->beams) << "the room closes all around";
    const std::set<int> landmarks = setAsideBeams(*report.scan);
    EXPECT_EQ(landmarks.size(), report.scan->set_aside.size());
    if (report.new_reference) {
      set_aside[report.stamp] = landmarks;
      references_with_landmarks += landmarks.empty() ? 0 : 1;
    }
    if (report.landmarks_used > 0) {
      EXPECT_GE(landmarks.size(), 6U * static_cast<std::size_t>(report.landmarks_used));
    }
    used += report.landmarks_used;
    if (!report.match.displacement) continue;
    const Displacement& z = *report.match.displacement;
    for (const int beam : landmarks) EXPECT_TRUE(z.J_current.col(beam).isZero(0.0)) << "beam " << beam;
    for (const int beam : set_aside.at(report.reference_stamp)) EXPECT_TRUE(z.J_reference.col(beam).isZero(0.0));
    EXPECT_GT(z.J_current.cwiseAbs().maxCoeff(), 0.0);
  }
  EXPECT_GT(used, 160) << "of 160 scans";
  EXPECT_GT(references_with_landmarks, 5);
  expectAccurate(drive, driven);
}

TEST_P(LandmarksOfEachKind, TheyTakeNoMoreThanTheirShareOfAScan) {
  const SimulatedDrive drive;
  for (const double share : {0.0, 0.2}) {
    PipelineOptions options = with(GetParam());
    options.landmarks.max_share = share;
    Driven driven(drive, options);
    driven.odometry(0);
    driven.run(0, 6000);
    std::size_t most = 0;
    for (const ScanReport& report : driven.reports) most = std::max(most, report.scan->set_aside.size());
    EXPECT_LE(most, share * 361.0);
    EXPECT_EQ(most > 0, share > 0.0);
    EXPECT_EQ(driven.reports.back().landmarks.empty(), share == 0.0);
  }
}

TEST(Landmarks, WithoutThemThereAreNone) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.odometry(0);
  driven.run(0, 3000);
  for (const ScanReport& report : driven.reports) {
    EXPECT_TRUE(report.landmarks.empty());
    EXPECT_TRUE(report.scan->set_aside.empty());
  }
}

TEST(Landmarks, AloneTheyCarryTheEstimateToo) {
  const SimulatedDrive drive;
  PipelineOptions options = with("corners");
  options.landmarks.only = true;
  options.landmarks.max_std = 0.5;  // the wheels alone lead from one to the next
  Driven driven(drive, options);
  driven.odometry(0);
  driven.run(0, 16000);
  EXPECT_GT(driven.count(ScanOutcome::kUpdated), 140U);
  for (const ScanReport& report : driven.reports) {
    EXPECT_FALSE(report.match.displacement);
    EXPECT_EQ(report.reason.empty(), report.outcome != ScanOutcome::kNoMatch);
  }
  EXPECT_LT(driven.latestError(16000).head<2>().norm(), 0.1);
}

TEST(Landmarks, OnlyOneMethodHasThem) {
  PipelineOptions options = with("corners");
  options.method = "sckf";
  try {
    const ScanOdometry pipeline(options);
    FAIL() << "taken";
  } catch (const std::invalid_argument& problem) {
    EXPECT_THAT(problem.what(), HasSubstr("landmarks is \"corners\": expected \"none\" with method \"sckf\""));
  }
}

TEST(Landmarks, OnlyThemThereMustBeSome) {
  PipelineOptions options;
  options.landmarks.only = true;
  try {
    const ScanOdometry pipeline(options);
    FAIL() << "taken";
  } catch (const std::invalid_argument& problem) {
    EXPECT_THAT(problem.what(), HasSubstr("landmarks_only is true: expected false with landmarks \"none\""));
  }
}

// ---- where they are, and how many

TEST(Landmarks, TheyAreTheCornersOfTheRoom) {
  const SimulatedDrive drive;
  Driven driven(drive, with("corners"));
  driven.odometry(0);
  driven.run(0, 16000);
  const auto& landmarks = driven.reports.back().landmarks;
  EXPECT_GE(landmarks.size(), 4U);
  for (const LandmarkView& landmark : landmarks) {
    const SE2 world_from_landmark = compose(roundDrive(0.0), landmark.odom_from_landmark);
    double nearest = 1e9;
    for (const Wall& wall : room()) nearest = std::min(nearest, (wall.from - world_from_landmark.translation()).norm());
    EXPECT_LT(nearest, 0.06) << world_from_landmark.vector().transpose();
    EXPECT_LT(std::sqrt(landmark.covariance.trace()), 0.1);
  }
}

TEST(Landmarks, NoMoreThanAllowed) {
  const SimulatedDrive drive;
  PipelineOptions options = with("corners");
  options.landmarks.max = 2;
  Driven driven(drive, options);
  driven.odometry(0);
  driven.run(0, 16000);
  std::size_t most = 0;
  for (const ScanReport& report : driven.reports) most = std::max(most, report.landmarks.size());
  EXPECT_EQ(most, 2U);
}

TEST(Landmarks, WhatIsTakenAwayIsGivenUpAndWhatIsHiddenIsNot) {
  // The room with its pillar, before which somebody stands for a while; then the pillar is gone.
  const World whole = room();
  const World empty(whole.begin(), whole.end() - 4);
  const SimulatedDrive before({}, 16000, whole);
  const SimulatedDrive after({}, 16000, empty);
  Driven driven(before, with("corners"));
  const auto pillars = [&] {
    std::size_t n = 0;
    for (const LandmarkView& landmark : driven.reports.back().landmarks) {
      const Eigen::Vector2d p = compose(roundDrive(0.0), landmark.odom_from_landmark).translation();
      n += (p - Eigen::Vector2d(1.9, 2.2)).norm() < 0.8 ? 1 : 0;
    }
    return n;
  };
  driven.odometry(0);
  driven.run(0, 8000);
  ASSERT_GE(pillars(), 1U);
  const std::size_t known = pillars();
  for (int ms = 8001; ms <= 10000; ++ms) {
    if (ms % 20 == 0) driven.odometry(ms);
    if (ms % 100 != 7) continue;
    LaserScan hidden = before.scan(ms);
    const Eigen::Vector2d pillar = inverse(roundDrive(1e-3 * ms)) * Eigen::Vector2d(1.9, 2.2);
    for (int i = 0; i < 361; ++i) {
      const double bearing = hidden.angle_min + i * hidden.angle_increment;
      const double off = wrapAngle(bearing - std::atan2(pillar.y(), pillar.x()));
      if (std::abs(off) < 0.6) hidden.ranges[static_cast<std::size_t>(i)] = 0.4F;
    }
    driven.scan(hidden);
  }
  EXPECT_EQ(pillars(), known) << "hidden";
  for (int ms = 10001; ms <= 15000; ++ms) {
    if (ms % 20 == 0) driven.odometry(ms);
    if (ms % 100 == 7) driven.scan(after.scan(ms));
  }
  EXPECT_EQ(pillars(), 0U) << "gone";
}

// ---- which corner is which

/// Five posts in a row, 1.6 m apart, each a corner that points at the robot.
World posts() {
  World world;
  for (double x = -3.2; x < 3.3; x += 1.6) {
    world.push_back({{x - 0.6, 3.3}, {x, 3.0}});
    world.push_back({{x, 3.0}, {x + 0.6, 3.3}});
  }
  return world;
}

std::shared_ptr<const PreparedScan> scanOf(const World& world, const SE2& pose) {
  SimulatedLaser laser;
  laser.beams = 1441;
  laser.angle_increment = 2.0 * M_PI / 1441.0;
  return prepareScan(simulateScan(world, pose, laser), Eigen::Isometry3d::Identity(), ScanOptions());
}

/// How many landmarks a scan updates at a pose that is so uncertain, after they have been seen at one that is certain.
int usedAt(const SE2& truth, const SE2& believed, const Eigen::Vector3d& std) {
  LandmarkOptions options;
  options.use = "corners";
  options.only = true;
  options.max_std = 1.0;
  Landmarks landmarks(options);
  MultiCloneFilter filter(SE2(), 1e-8 * Eigen::Matrix3d::Identity());
  for (int i = 0; i < 4; ++i) {
    landmarks.claim(scanOf(posts(), SE2()), filter, SurfaceOptions());
    landmarks.update(filter);
  }
  EXPECT_GE(filter.landmarks(), 4U);
  filter.propagate({believed, std.cwiseAbs2().asDiagonal()});
  landmarks.claim(scanOf(posts(), truth), filter, SurfaceOptions());
  const int used = landmarks.update(filter);
  if (used > 0) {
    EXPECT_LT(error(filter.pose(), truth).head<2>().norm(), 0.1);
  }
  return used;
}

TEST(Landmarks, ACornerThatMayBeTwoLandmarksIsNeither) {
  const SE2 truth(0.1, 0.0, 0.0);
  EXPECT_GE(usedAt(truth, SE2(), Eigen::Vector3d(0.1, 0.05, 0.02)), 4) << "certain enough";
  EXPECT_EQ(usedAt(truth, SE2(), Eigen::Vector3d(0.9, 0.05, 0.02)), 0) << "it may be the next one";
}

TEST(Landmarks, WhatIsTooUnlikelyIsNotTheSame) {
  EXPECT_EQ(usedAt(SE2(0.25, 0.0, 0.0), SE2(), Eigen::Vector3d(0.02, 0.02, 0.01)), 0);
}

// ---- a loop

/// A corridor about a square of 8 m with doors' recesses in its walls.
World ring() {
  World world = closedPolygon({{-4, -4}, {4, -4}, {4, -1}, {3.6, -1}, {3.6, 1}, {4, 1}, {4, 4}, {-4, 4}});
  const World outside = closedPolygon({{-6, -6},
                                       {-1, -6},
                                       {-1, -6.4},
                                       {1, -6.4},
                                       {1, -6},
                                       {6, -6},
                                       {6, 6},
                                       {0, 6},
                                       {0, 6.3},
                                       {-2, 6.3},
                                       {-2, 6},
                                       {-6, 6}});
  world.insert(world.end(), outside.begin(), outside.end());
  return world;
}

/// Round it in 40 s, in the middle of the corridor: 5 m from the centre, the corners rounded.
SE2 ringDrive(double t) {
  const double u = 2.0 * M_PI * t / 40.0;
  const auto at = [](double a) -> Eigen::Vector2d {
    const double c = std::cos(a);
    const double s = std::sin(a);
    return 5.0 * Eigen::Vector2d(c, s) / std::pow(std::pow(c, 8.0) + std::pow(s, 8.0), 0.125);
  };
  const Eigen::Vector2d ahead = at(u + 1e-4) - at(u - 1e-4);
  return {at(u).x(), at(u).y(), std::atan2(ahead.y(), ahead.x())};
}

/// Mean distance of the second pass from the first, where the robot was at the same places [m].
double gapBetweenPasses(const Driven& driven) {
  std::map<int, SE2> estimate;
  for (const ScanReport& report : driven.reports)
    estimate[milliseconds(report.stamp)] = report.estimate->odom_from_base;
  double sum = 0.0;
  int n = 0;
  for (const auto& [ms, pose] : estimate) {
    const auto again = estimate.find(ms + 40000);
    if (ms < 10000 || again == estimate.end()) continue;
    sum += error(again->second, pose).head<2>().norm();
    ++n;
  }
  return sum / n;
}

TEST(Landmarks, OnALoopTheSecondPassFallsOnTheFirst) {
  const auto gap = [](const std::string& use, double noise, bool only = false) {
    SimulatedDrive drive({}, 80000, ring(), ringDrive);
    drive.laser.noise = noise;
    drive.laser.range_max = 8.0;
    PipelineOptions options = with(use);
    options.landmarks.only = only;
    if (only) options.landmarks.max_std = 0.5;
    options.landmarks.line.std_offset = options.landmarks.line.std_yaw = 0.005;  // they are straight
    options.reference.kept = 4;              // of so short a way that none is kept when the robot comes by again
    options.reference.kf_dist_linear = 0.1;  // so that there is a drift to be taken back
    options.reference.kf_dist_angular = 0.3;
    options.reference.older_compared = 0;
    options.reference.matching_common = 0.0;     // straight walls are taken wrong by noise alone, each time anew
    options.matcher.estimation.place_std = 0.0;  // and nothing else
    options.matcher.both_ways = false;
    Driven driven(drive, options);
    driven.odometry(0);
    driven.run(0, 80000);
    return gapBetweenPasses(driven);
  };
  EXPECT_LT(gap("corners", 0.06), std::min(0.15, 0.5 * gap("none", 0.06)));
  EXPECT_LT(gap("lines", 0.03), std::min(0.05, 0.5 * gap("none", 0.03)));
  // The second pass is nearer to the truth: the wheels' scale is known then.
  EXPECT_LT(gap("lines", 0.03, true), 0.1) << "the wheels alone come back somewhere else";
}

}  // namespace
}  // namespace sckf::test
