#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "matching/simulated_world.h"
#include "sckf_odometry/matching/prepared_scan.h"

namespace sckf::test {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

const Eigen::Isometry3d kAtBase = Eigen::Isometry3d::Identity();

/// A flat wall 2 m ahead, seen by 91 beams.
LaserScan wallAhead() {
  LaserScan scan;
  scan.angle_min = -M_PI / 4.0;
  scan.angle_increment = M_PI / 180.0;
  scan.range_min = 0.1;
  scan.range_max = 10.0;
  for (int i = 0; i <= 90; ++i) scan.ranges.push_back(static_cast<float>(2.0 / std::cos((i - 45) * M_PI / 180.0)));
  return scan;
}

std::string rejectionOf(const LaserScan& scan, const Eigen::Isometry3d& mount = kAtBase) {
  std::string rejection;
  EXPECT_EQ(prepareScan(scan, mount, ScanOptions(), &rejection), nullptr);
  return rejection;
}

TEST(PreparedScan, KeepsEveryReadingOfAGoodScan) {
  const auto scan = prepareScan(wallAhead(), kAtBase, ScanOptions());
  ASSERT_NE(scan, nullptr);
  EXPECT_EQ(scan->beams, 91U);
  ASSERT_EQ(scan->size(), 91U);
  for (const Eigen::Vector2d& p : scan->points.point) EXPECT_NEAR(p.x(), 2.0, 1e-6);
}

TEST(PreparedScan, LeavesOutWhatIsNoReading) {
  LaserScan scan = wallAhead();
  scan.ranges[3] = std::numeric_limits<float>::quiet_NaN();
  scan.ranges[4] = std::numeric_limits<float>::infinity();   // nothing in range (REP-117)
  scan.ranges[5] = -std::numeric_limits<float>::infinity();  // too near (REP-117)
  scan.ranges[6] = 0.0F;
  scan.ranges[7] = 0.09F;   // below range_min
  scan.ranges[8] = 10.01F;  // above range_max
  scan.ranges[9] = -1.0F;
  const auto prepared = prepareScan(scan, kAtBase, ScanOptions());
  ASSERT_NE(prepared, nullptr);
  EXPECT_EQ(prepared->beams, 91U);
  ASSERT_EQ(prepared->size(), 84U);
  EXPECT_EQ(prepared->points.beam[2], 2);
  EXPECT_EQ(prepared->points.beam[3], 10);
}

/// As of a driver that fills a finer grid than its laser has.
TEST(PreparedScan, EmptyBeamsBetweenThoseOfTheLaserAreNoBeams) {
  std::mt19937_64 random(3);
  SimulatedLaser laser;
  laser.noise = 0.01;
  const LaserScan all = simulateScan(room(), SE2(), laser, &random);
  for (const std::size_t every : {2U, 3U}) {
    for (const float empty : {0.0F, std::numeric_limits<float>::infinity()}) {
      SCOPED_TRACE(testing::Message() << "1 of " << every << ", others " << empty);
      LaserScan scan = all;
      for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
        if (i % every != 1) scan.ranges[i] = empty;
      }
      const auto prepared = prepareScan(scan, kAtBase, ScanOptions());
      ASSERT_NE(prepared, nullptr);
      EXPECT_EQ(prepared->beams, (scan.ranges.size() + every - 2) / every);
      EXPECT_NEAR(prepared->angle_increment, static_cast<double>(every) * scan.angle_increment, 1e-12);
      EXPECT_NEAR(prepared->range_noise, 0.01, 0.005);
      EXPECT_TRUE(prepared->free_space.contains(0.5 * prepared->points.point[30]));
      const double bearing = scan.angle_min + (1.0 + 30.0 * static_cast<double>(every)) * scan.angle_increment;
      const Eigen::Vector2d& point = prepared->points.point[30];
      EXPECT_NEAR(std::remainder(std::atan2(point.y(), point.x()) - bearing, 2.0 * M_PI), 0.0, 1e-9);
    }
  }
}

TEST(PreparedScan, ItsOwnLimitsOfRangeHoldBesideTheScans) {
  ScanOptions options;
  options.range_max = 2.5;
  const auto prepared = prepareScan(wallAhead(), kAtBase, options);
  ASSERT_NE(prepared, nullptr);
  for (const double range : prepared->points.range) EXPECT_LE(range, 2.5);
  EXPECT_LT(prepared->size(), 91U);
}

TEST(PreparedScan, SaysWhatIsWrongWithABadScan) {
  LaserScan empty = wallAhead();
  empty.ranges.clear();
  EXPECT_THAT(rejectionOf(empty), HasSubstr("0 of 0 ranges"));

  LaserScan blind = wallAhead();
  for (float& range : blind.ranges) range = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(rejectionOf(blind), HasSubstr("0 of 91 ranges are finite and within [0.1, 10) m: expected at least 20"));

  LaserScan still = wallAhead();
  still.angle_increment = 0.0;
  EXPECT_THAT(rejectionOf(still), HasSubstr("angle_increment 0"));

  LaserScan nowhere = wallAhead();
  nowhere.angle_min = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(rejectionOf(nowhere), HasSubstr("angle_min is nan"));

  Eigen::Isometry3d tilted = kAtBase;
  tilted.rotate(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitY()));
  EXPECT_THAT(rejectionOf(wallAhead(), tilted), HasSubstr("tilted"));
}

TEST(PreparedScan, NamesTheValueThatIsWrong) {
  LaserScan degrees = wallAhead();
  degrees.angle_increment = 1.0;
  EXPECT_THAT(rejectionOf(degrees), HasSubstr("angle_increment 1 with 91 ranges: expected values in rad"));
  degrees = wallAhead();
  degrees.angle_min = -45.0;
  EXPECT_THAT(rejectionOf(degrees), HasSubstr("angle_min is -45"));

  LaserScan turned = wallAhead();
  std::swap(turned.range_min, turned.range_max);
  EXPECT_THAT(rejectionOf(turned), HasSubstr("range_min is 10, range_max 0.1: expected range_min below range_max"));
  turned.range_max = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(rejectionOf(turned), HasSubstr("range_max nan"));

  Eigen::Isometry3d far = kAtBase;
  far.translation().y() = 1e6;
  EXPECT_THAT(rejectionOf(wallAhead(), far), HasSubstr("mount is at (    0 1e+06     0)"));
}

/// What a laser that sees nothing says at every beam is no round room.
TEST(PreparedScan, TheLargestRangeItselfIsNoReading) {
  LaserScan blind = wallAhead();
  for (float& range : blind.ranges) range = 10.0F;
  EXPECT_THAT(rejectionOf(blind), HasSubstr("0 of 91 ranges"));
}

TEST(PreparedScan, OfTooManyBeamsSomeAreLeftOutEvenly) {
  SimulatedLaser laser;
  laser.beams = 100000;
  laser.angle_increment = 2.0 * M_PI / laser.beams;
  ScanOptions options;
  options.max_beams = 1500;
  const auto dense = prepareScan(simulateScan(room(), SE2(), laser), kAtBase, options);
  ASSERT_NE(dense, nullptr);
  EXPECT_EQ(dense->beams, 1493U);  // every 67th
  EXPECT_EQ(dense->rangeVariances().size(), 1493);
  ASSERT_EQ(dense->size(), 1493U);
  for (std::size_t i = 0; i < dense->size(); i += 100) {
    const double bearing = laser.angle_min + 67.0 * static_cast<double>(i) * laser.angle_increment;
    EXPECT_NEAR(wrapAngle(std::atan2(dense->points.point[i].y(), dense->points.point[i].x()) - bearing), 0.0, 1e-6);
  }
  options.max_beams = 100000;
  EXPECT_EQ(prepareScan(simulateScan(room(), SE2(), laser), kAtBase, options)->beams, 100000U);
}

TEST(PreparedScan, TheMountTakesPointsToTheBase) {
  // Upside down, looking back and 0.3 m behind: beam 0, which looks to the right of the laser, looks to the right of
  // the robot's back as seen along it, and the wall is 2.3 m behind the base.
  Eigen::Isometry3d mount = Eigen::Isometry3d::Identity();
  mount.translation().x() = -0.3;
  mount.rotate(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitY()));
  const auto prepared = prepareScan(wallAhead(), mount, ScanOptions());
  ASSERT_NE(prepared, nullptr);
  for (const Eigen::Vector2d& p : prepared->points.point) EXPECT_NEAR(p.x(), -2.3, 1e-6);
  EXPECT_NEAR(prepared->points.point.front().y(), -2.0, 1e-5);
  EXPECT_NEAR(prepared->points.point.back().y(), 2.0, 1e-5);
}

TEST(PreparedScan, EstimatesTheNoiseOfItsRanges) {
  std::mt19937_64 random(1);
  for (const double noise : {0.02, 0.05}) {
    SimulatedLaser laser;
    laser.noise = noise;
    double sum = 0.0;
    for (int i = 0; i < 20; ++i) {
      const auto scan = prepareScan(simulateScan(room(), SE2(), laser, &random), kAtBase, ScanOptions());
      ASSERT_NE(scan, nullptr);
      sum += scan->range_noise;
    }
    EXPECT_NEAR(sum / 20.0, noise, 0.1 * noise);
  }
}

TEST(PreparedScan, BelievesNoScanToBeBetterOrWorseThanItsLimits) {
  ScanOptions options;
  const auto perfect = prepareScan(wallAhead(), kAtBase, options);
  ASSERT_NE(perfect, nullptr);
  EXPECT_DOUBLE_EQ(perfect->range_noise, options.range_noise_min);
  EXPECT_DOUBLE_EQ(perfect->rangeVariances()(5), options.range_noise_min * options.range_noise_min);
  EXPECT_EQ(perfect->rangeVariances().size(), 91);

  std::mt19937_64 random(2);
  SimulatedLaser wild;
  wild.noise = 0.5;
  const auto noisy = prepareScan(simulateScan(room(), SE2(), wild, &random), kAtBase, options);
  ASSERT_NE(noisy, nullptr);
  EXPECT_DOUBLE_EQ(noisy->range_noise, options.range_noise_max);
}

TEST(Surfaces, HaveTheNormalOfTheWallTowardsTheLaser) {
  const auto scan = prepareScan(wallAhead(), kAtBase, ScanOptions());
  ASSERT_NE(scan, nullptr);
  for (const Surface& surface : scan->surface) {
    ASSERT_TRUE(surface.valid());
    EXPECT_NEAR(surface.normal.x(), -1.0, 1e-6);
    EXPECT_NEAR(surface.normal.y(), 0.0, 1e-6);
    EXPECT_NEAR(surface.centroid.x(), 2.0, 1e-6);
  }
}

TEST(Surfaces, NormalsOfNoisyDenseScansAreKnownAsWellAsTheyClaim) {
  std::mt19937_64 random(3);
  SimulatedLaser laser;
  laser.beams = 720;
  laser.angle_increment = M_PI / 360.0;
  laser.noise = 0.05;
  const World hall = closedPolygon({{-4.0, -4.0}, {4.0, -4.0}, {4.0, 4.0}, {-4.0, 4.0}});
  const ScanOptions options;
  double normalised_square = 0.0;
  int count = 0;
  for (int run = 0; run < 20; ++run) {
    const auto scan = prepareScan(simulateScan(hall, SE2(), laser, &random), kAtBase, options);
    ASSERT_NE(scan, nullptr);
    for (std::size_t i = 0; i < scan->size(); i += 20) {
      const Surface& surface = scan->surface[i];
      const Eigen::Vector2d& p = scan->points.point[i];
      const bool mid_wall = std::min(std::abs(p.x()), std::abs(p.y())) < 2.0;
      if (!surface.valid() || !mid_wall) continue;
      const Eigen::Vector2d truth = std::abs(p.x()) > std::abs(p.y())
                                        ? Eigen::Vector2d(-std::copysign(1.0, p.x()), 0.0)
                                        : Eigen::Vector2d(0.0, -std::copysign(1.0, p.y()));
      const double angle = std::asin(truth.x() * surface.normal.y() - truth.y() * surface.normal.x());
      const double angle_std = scan->range_noise / std::sqrt(surface.spread);
      EXPECT_LT(angle_std, options.surface.max_normal_std);
      normalised_square += angle * angle / (angle_std * angle_std);
      ++count;
    }
  }
  ASSERT_GT(count, 200);
  // Rays that graze the wall turn range noise into less noise across it, so the claim is on the safe side.
  EXPECT_LT(normalised_square / count, 1.5);
  EXPECT_GT(normalised_square / count, 0.3);
}

/// Of scans of a world, with noise [m], from places along x up to half a metre to either side of the origin.
template <typename Look>
void lookAtSurfaces(const World& world, double noise, double step, double y, std::uint64_t seed, const Look& look) {
  std::mt19937_64 random(seed);
  SimulatedLaser laser;
  laser.noise = noise;
  for (double x = -0.5; x < 0.5; x += step) {
    const SE2 pose(x, y, 0.0);
    const auto scan = prepareScan(simulateScan(world, pose, laser, &random), kAtBase, ScanOptions());
    ASSERT_NE(scan, nullptr);
    for (std::size_t i = 0; i < scan->size(); ++i) look(pose, scan->points.point[i], scan->surface[i]);
  }
}

//      ____    ____      The niches of doors in one wall of a corridor. A stretch that ends in one is turned by it, and
//  ___|    |__|    |__   the scatter does not tell, as range noise hardly shows across a wall at a small angle.
//   >                    Short stretches are turned by the noise alone now and then.
TEST(Surfaces, NichesOfDoorsDoNotTurnAWall) {
  constexpr double kDepth = 0.12;   // [m]
  constexpr double kTurned = 0.05;  // [rad]
  std::vector<Eigen::Vector2d> corners = {{-2.0, -1.0}};
  for (double x = 1.0; x < 17.0; x += 2.1) {
    corners.insert(corners.end(), {{x, -1.0}, {x, -1.0 - kDepth}, {x + 0.9, -1.0 - kDepth}, {x + 0.9, -1.0}});
  }
  corners.insert(corners.end(), {{19.0, -1.0}, {19.0, 1.2}, {-2.0, 1.2}});
  const World corridor = closedPolygon(corners);
  int on_wall = 0;
  int turned = 0;
  lookAtSurfaces(corridor, 0.015, 0.02, 0.0, 4, [&](const SE2&, const Eigen::Vector2d& p, const Surface& surface) {
    if (!surface.valid() || p.x() < 1.0 || p.x() > 12.0 || p.y() > -0.9) return;
    ++on_wall;
    turned += std::abs(surface.normal.x()) > kTurned ? 1 : 0;
  });
  ASSERT_GT(on_wall, 500);
  EXPECT_LT(turned, 0.3 * on_wall) << turned << " of " << on_wall << " surfaces are turned";
}

/// Around most points near a corner no stretch is straight.
TEST(Surfaces, ReachUpToTheCornersOfARoom) {
  constexpr double kNear = 0.4;  // [m]
  const World room = closedPolygon({{-3.0, -3.0}, {3.0, -3.0}, {3.0, 3.0}, {-3.0, 3.0}});
  int near_corner = 0;
  int with_surface = 0;
  lookAtSurfaces(room, 0.01, 0.1, 0.3, 5, [&](const SE2& pose, const Eigen::Vector2d& p, const Surface& surface) {
    if ((p + pose.translation()).cwiseAbs().minCoeff() < 3.0 - kNear) return;
    ++near_corner;
    with_surface += surface.valid() && surface.normal.cwiseAbs().maxCoeff() > std::cos(0.03) ? 1 : 0;
  });
  ASSERT_GT(near_corner, 300);
  EXPECT_GT(with_surface, 0.8 * near_corner) << with_surface << " of " << near_corner;
}

TEST(Surfaces, DoNotReachAcrossADepthDiscontinuity) {
  LaserScan scan = wallAhead();
  for (std::size_t i = 45; i < scan.ranges.size(); ++i) scan.ranges[i] *= 2.0F;  // the wall behind is 4 m away
  const auto prepared = prepareScan(scan, kAtBase, ScanOptions());
  ASSERT_NE(prepared, nullptr);
  for (std::size_t i = 0; i < prepared->size(); ++i) {
    const Surface& surface = prepared->surface[i];
    if (!surface.valid()) continue;
    EXPECT_NEAR(surface.centroid.x(), i < 45 ? 2.0 : 4.0, 1e-5) << "point " << i;
  }
}

}  // namespace
}  // namespace sckf::test
