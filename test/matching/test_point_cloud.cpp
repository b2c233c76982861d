#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "sckf_odometry/matching/point_cloud.h"

namespace sckf {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// 36 bins of 10°, the first of them from -180° on: straight ahead begins bin 18.
CloudOptions coarse() {
  CloudOptions options;
  options.beams = 36;
  return options;
}

MountedScan projected(const std::vector<Eigen::Vector3f>& points,
                      const Eigen::Isometry3d& base_from_sensor = Eigen::Isometry3d::Identity()) {
  return sckf::projected(points, std::chrono::seconds(7), base_from_sensor, coarse());
}

/// Index and range of the bins that have a point.
std::vector<std::pair<int, float>> readings(const LaserScan& scan) {
  std::vector<std::pair<int, float>> readings;
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    if (std::isfinite(scan.ranges[i])) readings.emplace_back(static_cast<int>(i), scan.ranges[i]);
  }
  return readings;
}

using Readings = std::vector<std::pair<int, float>>;

TEST(PointCloud, BecomesAScanAllAround) {
  const LaserScan scan = projected({}).scan;
  EXPECT_EQ(scan.stamp, std::chrono::seconds(7));
  EXPECT_EQ(scan.ranges.size(), 36U);
  EXPECT_NEAR(scan.angle_min, -175.0 * M_PI / 180.0, 1e-12) << "the middle of the first bin";
  EXPECT_NEAR(scan.angle_increment, 10.0 * M_PI / 180.0, 1e-12);
  EXPECT_EQ(scan.time_increment, 0.0);
  EXPECT_EQ(scan.range_min, 0.1);
  EXPECT_EQ(scan.range_max, 50.0);
  EXPECT_EQ(readings(scan), Readings{});
}

TEST(PointCloud, OfABinTheNearestPointIsTaken) {
  EXPECT_EQ(readings(projected({{4.0F, 0.1F, 0.5F}, {3.0F, 0.0F, 0.3F}, {5.0F, 0.2F, 0.9F}}).scan),
            (Readings{{18, 3.0F}}));
}

TEST(PointCloud, BinsAreCountedCounterClockwiseFromBehind) {
  EXPECT_EQ(readings(projected({{-2.0F, -0.01F, 0.5F}}).scan), (Readings{{0, std::hypot(2.0F, 0.01F)}}));
  EXPECT_EQ(readings(projected({{0.01F, -2.0F, 0.5F}}).scan), (Readings{{9, std::hypot(2.0F, 0.01F)}}));
  EXPECT_EQ(readings(projected({{-0.01F, 2.0F, 0.5F}}).scan), (Readings{{27, std::hypot(2.0F, 0.01F)}}));
  EXPECT_EQ(readings(projected({{-2.0F, 0.0F, 0.5F}}).scan), (Readings{{35, 2.0F}})) << "half a turn is the last bin";
}

TEST(PointCloud, OnlyTheBandOfHeightIsSeen) {
  EXPECT_EQ(readings(projected({{1.0F, 0.0F, 0.099F}, {1.5F, 0.0F, 1.001F}, {2.0F, 0.0F, -0.5F}}).scan), Readings{});
  EXPECT_EQ(readings(projected({{2.0F, 0.0F, 0.101F}}).scan), (Readings{{18, 2.0F}}));
  EXPECT_EQ(readings(projected({{2.0F, 0.0F, 0.999F}}).scan), (Readings{{18, 2.0F}}));
}

TEST(PointCloud, RangesAreSeenFromAboveWithinTheirLimits) {
  EXPECT_EQ(readings(projected({{0.06F, 0.06F, 0.9F}}).scan), Readings{}) << "0.085 m in the plane";
  EXPECT_EQ(readings(projected({{50.0F, 0.0F, 0.5F}}).scan), Readings{});
  EXPECT_EQ(readings(projected({{49.0F, 0.0F, 0.5F}}).scan), (Readings{{18, 49.0F}}));
}

TEST(PointCloud, WhatIsNotFiniteIsNoPoint) {
  EXPECT_EQ(readings(projected({{kNaN, 0.0F, 0.5F}, {1.0F, kNaN, 0.5F}, {1.0F, 0.0F, kNaN}}).scan), Readings{});
  EXPECT_EQ(readings(projected({{kInfinity, 0.0F, 0.5F}, {1.0F, -kInfinity, 0.5F}, {1.0F, 0.0F, kInfinity}}).scan),
            Readings{});
}

TEST(PointCloud, HeightIsThatAboveTheBaseAndBearingsAreThoseFromTheSensor) {
  // A sensor that looks to the left and 30° down, 0.8 m high, 0.5 m ahead of the base: 2 m along its axis is
  // 1.732 m to the left, 1 m lower: below the floor; 1 m along is 0.866 m to the left at 0.3 m.
  const Eigen::Isometry3d mount = Eigen::Translation3d(0.5, 0.0, 0.8) *
                                  Eigen::AngleAxisd(M_PI_2, Eigen::Vector3d::UnitZ()) *
                                  Eigen::AngleAxisd(M_PI / 6.0, Eigen::Vector3d::UnitY());
  const MountedScan mounted = projected({{2.0F, 0.0F, 0.0F}, {1.0F, -0.01F, 0.0F}}, mount);
  const auto seen = readings(mounted.scan);
  ASSERT_EQ(seen.size(), 1U);
  EXPECT_EQ(seen[0].first, 26) << "just right of straight left";
  EXPECT_NEAR(seen[0].second, 0.86608, 1e-4);
  Eigen::Isometry3d level = Eigen::Isometry3d::Identity();
  level.translation() << 0.5, 0.0, 0.0;
  EXPECT_TRUE(mounted.base_from_laser.isApprox(level, 1e-12));
}

TEST(PointCloud, PointsOfTheScanAreWhereTheyWereToHalfABin) {
  CloudOptions options;
  options.beams = 720;
  const Eigen::Isometry3d mount = Eigen::Translation3d(0.3, -0.2, 0.4) *
                                  Eigen::AngleAxisd(2.0, Eigen::Vector3d::UnitZ()) *
                                  Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX());
  for (double bearing = -3.1; bearing < 3.1; bearing += 0.1) {
    const Eigen::Vector3d in_base(3.0 * std::cos(bearing), 3.0 * std::sin(bearing), 0.5);
    const Eigen::Vector3f in_sensor = (mount.inverse() * in_base).cast<float>();
    const MountedScan mounted = sckf::projected({in_sensor}, Stamp(1), mount, options);
    const auto seen = readings(mounted.scan);
    ASSERT_EQ(seen.size(), 1U);
    const double angle = mounted.scan.angle_min + seen[0].first * mounted.scan.angle_increment;
    const double range = static_cast<double>(seen[0].second);
    const Eigen::Vector3d back =
        mounted.base_from_laser * Eigen::Vector3d(range * std::cos(angle), range * std::sin(angle), 0.0);
    EXPECT_LT((back - in_base).head<2>().norm(), 3.4 * M_PI / 720.0) << bearing;
  }
}

}  // namespace
}  // namespace sckf
