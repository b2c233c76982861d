// What the beams of a scan went through.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "matching/simulated_world.h"
#include "sckf_odometry/matching/prepared_scan.h"

namespace sckf::test {
namespace {

/// Nine beams of 10 degrees from -40 to 40, all of 4 m.
LaserScan fan() {
  LaserScan scan;
  scan.angle_min = -4 * M_PI / 18;
  scan.angle_increment = M_PI / 18;
  scan.range_max = 20.0;
  scan.ranges.assign(9, 4.0F);
  return scan;
}

FreeSpace freeSpace(const LaserScan& scan, const Eigen::Isometry3d& mount = Eigen::Isometry3d::Identity()) {
  ScanOptions options;
  options.min_points = 3;
  const auto prepared = prepareScan(scan, mount, options);
  EXPECT_NE(prepared, nullptr);
  return {scan, mount, prepared->points, 0.15};
}

Eigen::Vector2d at(double range, double degrees) {
  return range * Eigen::Vector2d(std::cos(degrees * M_PI / 180), std::sin(degrees * M_PI / 180));
}

TEST(FreeSpace, ReachesUpToWhatWasSeen) {
  const FreeSpace free = freeSpace(fan());
  for (const double degrees : {-30.0, -2.0, 0.0, 14.0, 30.0}) {
    EXPECT_TRUE(free.contains(at(0.5, degrees))) << degrees;
    EXPECT_TRUE(free.contains(at(3.8, degrees))) << degrees;
    EXPECT_FALSE(free.contains(at(3.9, degrees))) << degrees << ": may be a part of what was seen";
    EXPECT_FALSE(free.contains(at(6.0, degrees))) << degrees << ": behind it";
  }
}

TEST(FreeSpace, EndsWithTheFieldOfView) {
  const FreeSpace free = freeSpace(fan());
  for (const double degrees : {-60.0, -46.0, 46.0, 90.0, 180.0})
    EXPECT_FALSE(free.contains(at(1.0, degrees))) << degrees;
  EXPECT_FALSE(free.contains(at(1.0, 40.0))) << "the beam beside it has not been";
}

TEST(FreeSpace, AllBeamsAroundAPointHaveToGoPastIt) {
  LaserScan scan = fan();
  scan.ranges[4] = 2.0F;
  const FreeSpace free = freeSpace(scan);
  for (const double degrees : {-10.0, 0.0, 10.0}) {
    EXPECT_FALSE(free.contains(at(3.0, degrees))) << degrees;
    EXPECT_TRUE(free.contains(at(1.5, degrees))) << degrees;
  }
  EXPECT_TRUE(free.contains(at(3.0, 20.0)));
}

TEST(FreeSpace, WhereABeamToldNothingNothingIsKnown) {
  LaserScan scan = fan();
  scan.ranges[4] = std::numeric_limits<float>::infinity();
  const FreeSpace free = freeSpace(scan);
  for (const double degrees : {-10.0, 0.0, 10.0}) EXPECT_FALSE(free.contains(at(1.0, degrees))) << degrees;
  EXPECT_TRUE(free.contains(at(1.0, 20.0)));
  EXPECT_FALSE(FreeSpace().contains(at(1.0, 0.0)));
}

TEST(FreeSpace, MovesWithTheMount) {
  LaserScan scan = fan();
  scan.ranges[7] = 2.0F;  // at 30 degrees about the laser's z
  const auto mounted = [](double x, double yaw, bool upside_down) {
    Eigen::Isometry3d mount = Eigen::Translation3d(x, 0.0, 0.3) * Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
                              Eigen::AngleAxisd(upside_down ? M_PI : 0.0, Eigen::Vector3d::UnitX());
    return mount;
  };
  const Eigen::Vector2d ahead(0.5, 0.0);
  for (const double yaw : {0.0, 150.0, -170.0}) {
    const double radians = yaw * M_PI / 180;
    const FreeSpace upright = freeSpace(scan, mounted(0.5, radians, false));
    EXPECT_FALSE(upright.contains(ahead + at(3.0, yaw + 30.0))) << yaw;
    EXPECT_TRUE(upright.contains(ahead + at(3.0, yaw - 30.0))) << yaw;
    const FreeSpace upside_down = freeSpace(scan, mounted(0.5, radians, true));
    EXPECT_TRUE(upside_down.contains(ahead + at(3.0, yaw + 30.0))) << yaw;
    EXPECT_FALSE(upside_down.contains(ahead + at(3.0, yaw - 30.0))) << yaw;
  }
}

TEST(FreeSpace, ALaserAllRoundHasNoEdgeAtTheTurn) {
  LaserScan scan = fan();
  scan.angle_min = -M_PI;
  scan.angle_increment = -M_PI / 90;  // clockwise
  scan.ranges.assign(180, 4.0F);
  const FreeSpace free = freeSpace(scan);
  for (double degrees = -170.0; degrees < 171.0; degrees += 10.0)
    EXPECT_TRUE(free.contains(at(3.0, degrees))) << degrees;
}

/// What a scan has seen is not where it has looked through, however its points have come to be where they are.
int pointsInItsOwn(const PreparedScan& scan) {
  return static_cast<int>(
      std::count_if(scan.points.point.begin(), scan.points.point.end(),
                    [&scan](const Eigen::Vector2d& point) { return scan.free_space.contains(point); }));
}

TEST(FreeSpace, ATiltedLaserLooksAsFarAsItsPointsAreInThePlane) {
  const Eigen::Isometry3d tilted(Eigen::AngleAxisd(15.0 * M_PI / 180.0, Eigen::Vector3d::UnitY()));
  const auto prepared = prepareScan(simulateScan(room(), SE2(0.3, 0.2, 0.4), SimulatedLaser()), tilted, {});
  EXPECT_EQ(pointsInItsOwn(*prepared), 0);
  EXPECT_TRUE(prepared->free_space.contains(0.5 * prepared->points.point[40]));
}

TEST(FreeSpace, OfARobotThatTurnsIsWhereItsPointsAre) {
  LaserScan scan = simulateScan(room(), SE2(0.3, 0.2, 0.4), SimulatedLaser());
  scan.time_increment = 0.09 / static_cast<double>(scan.ranges.size());
  ScanMotion motion;
  motion.add(SE2(0.04, 0.0, 0.3), 0.09);
  const auto prepared = prepareScan(scan, Eigen::Isometry3d::Identity(), {}, nullptr, motion);
  EXPECT_LE(pointsInItsOwn(*prepared), 2) << "of " << prepared->size();
  EXPECT_TRUE(prepared->free_space.contains(0.5 * prepared->points.point[40]));
}

TEST(FreeSpace, BeamsMayBeSoNearEachOtherThatNoIntegerCountsThem) {
  LaserScan scan = fan();
  for (const double increment : {1e-30, -1e-30}) {
    scan.angle_increment = increment;
    const FreeSpace free = freeSpace(scan);
    for (const double degrees : {-170.0, -10.0, 0.0, 10.0, 90.0}) EXPECT_FALSE(free.contains(at(1.0, degrees)));
  }
}

}  // namespace
}  // namespace sckf::test
