#include <gtest/gtest.h>

#include "core/matrix_matchers.h"
#include "matching/simulated_world.h"
#include "sckf_odometry/matching/prepared_scan.h"
#include "sckf_odometry/matching/scan_motion.h"

namespace sckf::test {
namespace {

/// Turns at 2 rad/s while it drives at 0.7 m/s.
SE2 turning(double t) {
  const double yaw = 2.0 * t;
  return {0.35 * std::sin(yaw), 0.35 * (1.0 - std::cos(yaw)), yaw};
}

/// What odometry at 100 Hz tells of a path, over so many of its samples.
ScanMotion motionAlong(const std::function<SE2(double)>& path, int samples) {
  ScanMotion motion;
  for (int i = 0; i < samples; ++i) motion.add(between(path(0.01 * i), path(0.01 * (i + 1))), 0.01);
  return motion;
}

/// A laser in front of the base, upside down, whose sweep takes 0.1 s.
SimulatedLaser sweepingLaser() {
  SimulatedLaser laser;
  laser.time_increment = 0.1 / (laser.beams - 1);
  laser.base_from_laser = Eigen::Translation3d(0.3, -0.1, 0.2) * Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ()) *
                          Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX());
  return laser;
}

/// The largest distance of a point of the scan, in base_link at its stamp, from the walls as they are there.
double farthestFromWalls(const PreparedScan& scan) {
  double farthest = 0.0;
  for (const Eigen::Vector2d& point : scan.points.point) {
    double nearest = 1e9;
    for (const Wall& wall : room()) {
      const Eigen::Vector2d along = wall.to - wall.from;
      const double share = std::clamp((point - wall.from).dot(along) / along.squaredNorm(), 0.0, 1.0);
      nearest = std::min(nearest, (point - wall.from - share * along).norm());
    }
    farthest = std::max(farthest, nearest);
  }
  return farthest;
}

TEST(ScanMotion, WithoutPartsIsAtRest) {
  const ScanMotion motion;
  EXPECT_TRUE(motion.atRest());
  EXPECT_EQ(motion.duration(), 0.0);
  EXPECT_TRUE(matricesNear(motion.at(3.0).vector(), Eigen::Vector3d::Zero(), 0.0));
}

TEST(ScanMotion, IsEvenWithinAPartAndGoesOnFromPartToPart) {
  ScanMotion motion;
  motion.add(SE2(0.2, 0.0, M_PI_2), 0.1);
  motion.add(SE2(0.3, 0.1, -0.4), 0.2);
  EXPECT_FALSE(motion.atRest());
  EXPECT_NEAR(motion.duration(), 0.3, 1e-15);
  EXPECT_TRUE(matricesNear(motion.at(0.0).vector(), Eigen::Vector3d::Zero(), 0.0));
  EXPECT_TRUE(matricesNear(motion.at(0.05).vector(), Eigen::Vector3d(0.1, 0.0, M_PI_4), 1e-15));
  EXPECT_TRUE(matricesNear(motion.at(0.1).vector(), Eigen::Vector3d(0.2, 0.0, M_PI_2), 1e-15));
  // Half of the second part is (0.15, 0.05), which after a quarter turn is (-0.05, 0.15).
  EXPECT_TRUE(matricesNear(motion.at(0.2).vector(), Eigen::Vector3d(0.15, 0.15, M_PI_2 - 0.2), 1e-15));
  EXPECT_TRUE(matricesNear(motion.at(0.3).vector(), Eigen::Vector3d(0.1, 0.3, M_PI_2 - 0.4), 1e-15));
}

TEST(ScanMotion, EndsWhereItIsNotKnown) {
  ScanMotion motion;
  motion.add(SE2(0.2, 0.0, 0.1), 0.1);
  EXPECT_TRUE(matricesNear(motion.at(-1.0).vector(), Eigen::Vector3d::Zero(), 0.0));
  EXPECT_TRUE(matricesNear(motion.at(1.0).vector(), Eigen::Vector3d(0.2, 0.0, 0.1), 1e-15));
}

TEST(Deskewing, BringsThePointsToTheStamp) {
  const SimulatedLaser laser = sweepingLaser();
  const LaserScan scan = simulateSweep(room(), turning, laser);
  const auto skewed = prepareScan(scan, laser.base_from_laser, ScanOptions());
  const auto straight = prepareScan(scan, laser.base_from_laser, ScanOptions(), nullptr, motionAlong(turning, 10));
  ASSERT_TRUE(skewed && straight);
  ASSERT_EQ(straight->size(), skewed->size());
  EXPECT_GT(farthestFromWalls(*skewed), 0.5) << "0.2 rad over a room of 9 m";
  EXPECT_LT(farthestFromWalls(*straight), 1e-3) << "what is left: motion is even between samples of odometry";
}

TEST(Deskewing, OfAThinnedScanIsTheSame) {
  SimulatedLaser laser = sweepingLaser();
  laser.beams = 1440;
  laser.angle_increment = 2.0 * M_PI / laser.beams;
  laser.time_increment = 0.1 / (laser.beams - 1);
  ScanOptions options;
  options.max_beams = 360;
  const LaserScan scan = simulateSweep(room(), turning, laser);
  const auto thinned = prepareScan(scan, laser.base_from_laser, options, nullptr, motionAlong(turning, 10));
  ASSERT_NE(thinned, nullptr);
  EXPECT_EQ(thinned->beams, 360U);
  EXPECT_LT(farthestFromWalls(*thinned), 1e-3);
}

TEST(Deskewing, RaysAreTheDerivativesOfThePoints) {
  constexpr double kStep = 1e-2;  // linear: ranges are floats, and a small step is rounding
  const SimulatedLaser laser = sweepingLaser();
  const ScanMotion motion = motionAlong(turning, 10);
  const LaserScan scan = simulateSweep(room(), turning, laser);
  LaserScan longer = scan;
  for (float& range : longer.ranges) range += static_cast<float>(kStep);
  const auto a = prepareScan(scan, laser.base_from_laser, ScanOptions(), nullptr, motion);
  const auto b = prepareScan(longer, laser.base_from_laser, ScanOptions(), nullptr, motion);
  ASSERT_TRUE(a && b);
  ASSERT_EQ(a->size(), b->size());
  for (std::size_t i = 0; i < a->size(); ++i) {
    const Eigen::Vector2d difference = (b->points.point[i] - a->points.point[i]) / kStep;
    EXPECT_TRUE(matricesNear(a->points.ray[i], difference, 1e-3)) << "beam " << a->points.beam[i];
  }
}

TEST(Deskewing, AtRestChangesNothing) {
  const SimulatedLaser laser = sweepingLaser();
  const LaserScan scan = simulateScan(room(), SE2(0.3, 0.2, 1.0), laser);
  ScanMotion still;
  still.add(SE2(), 0.1);
  const auto a = prepareScan(scan, laser.base_from_laser, ScanOptions());
  const auto b = prepareScan(scan, laser.base_from_laser, ScanOptions(), nullptr, still);
  ASSERT_TRUE(a && b);
  for (std::size_t i = 0; i < a->size(); ++i) {
    EXPECT_TRUE(matricesNear(a->points.point[i], b->points.point[i], 1e-14));
  }
}

/// Of the turning robot, whose motion is even.
EvenSweep evenSweep(double duration) { return {Eigen::Vector3d(0.7, 0.0, 2.0), duration}; }

/// By a laser as above, about the stamp.
std::shared_ptr<const PreparedScan> sweptAbout(const EvenSweep& taken, const EvenSweep& undone) {
  const SimulatedLaser laser = sweepingLaser();
  const auto along = [&taken](double t) { return taken.at(t / 0.1 - 0.5); };
  ScanOptions options;
  options.sweep = undone;
  return prepareScan(simulateSweep(room(), along, laser), laser.base_from_laser, options);
}

TEST(EvenSweep, IsUndoneAboutTheStamp) {
  const double with = farthestFromWalls(*sweptAbout(evenSweep(0.1), evenSweep(0.1)));
  const double without = farthestFromWalls(*sweptAbout(evenSweep(0.1), {}));
  EXPECT_LT(with, 1e-5) << "m; without: " << without;
  EXPECT_GT(without, 0.1);
  EXPECT_LT(farthestFromWalls(*sweptAbout(evenSweep(-0.1), evenSweep(-0.1))), 1e-5) << "the last beam first";
}

TEST(EvenSweep, ItsDerivativeByTheDurationIsThatOfThePoints) {
  const double step = 1e-4;
  const auto scan = sweptAbout(evenSweep(0.1), evenSweep(0.02));
  const auto longer = sweptAbout(evenSweep(0.1), evenSweep(0.02 + step));
  const auto shorter = sweptAbout(evenSweep(0.1), evenSweep(0.02 - step));
  ASSERT_EQ(scan->size(), 361U);
  for (std::size_t i = 0; i < scan->size(); ++i) {
    const Eigen::Vector2d numerical = (longer->points.point[i] - shorter->points.point[i]) / (2.0 * step);
    // Of the second order is left what the translation turns by while the robot turns: 2 rad/s · 0.7 m/s · 0.02 s.
    EXPECT_LT((scan->bySweepDuration(i) - numerical).norm(), 0.03) << i << ": " << numerical.transpose();
  }
}

TEST(EvenSweep, AMotionThatIsToldBeamByBeamIsUndoneInstead) {
  ScanMotion motion;
  motion.add(SE2(0.07, 0.0, 0.2), 0.1);
  ScanOptions options;
  options.sweep = evenSweep(0.1);
  const SimulatedLaser laser = sweepingLaser();
  const LaserScan scan = simulateSweep(
      room(), [&motion](double t) { return motion.at(t); }, laser);
  const auto prepared = prepareScan(scan, laser.base_from_laser, options, nullptr, motion);
  EXPECT_LT(farthestFromWalls(*prepared), 1e-5);
  EXPECT_EQ(prepared->sweep.duration, 0.0);
  EXPECT_EQ(prepared->bySweepDuration(0).norm(), 0.0);
}

}  // namespace
}  // namespace sckf::test
