#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "sckf_odometry/pipeline/no_return.h"

namespace sckf {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kDegree = M_PI / 180.0;

/// Half a turn of 181 beams, all of which read the same.
LaserScan scanOf(float range) {
  LaserScan scan;
  scan.angle_min = -M_PI_2;
  scan.angle_increment = kDegree;
  scan.range_max = 50.0;
  scan.ranges.assign(181, range);
  return scan;
}

/// Near walls, and this number from one beam to another one.
LaserScan scanWith(float number, std::size_t from, std::size_t to) {
  LaserScan scan = scanOf(0.0F);
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) scan.ranges[i] = 1.0F + 0.01F * static_cast<float>(i);
  for (std::size_t i = from; i <= to; ++i) scan.ranges[i] = number;
  return scan;
}

/// A wall so far ahead, as a laser tells it that rounds.
LaserScan scanOfAWall(double distance, double rounding) {
  LaserScan scan = scanOf(0.0F);
  for (std::size_t i = 60; i <= 120; ++i) {
    const double range = distance / std::sin(static_cast<double>(i) * kDegree);
    scan.ranges[i] = static_cast<float>(rounding * std::round(range / rounding));
  }
  return scan;
}

TEST(NoReturn, IsTheNumberThatMakesAnArc) {
  NoReturn no_return;
  EXPECT_EQ(no_return.value(), kInfinity);
  no_return.look(scanWith(8.19F, 70, 110));
  EXPECT_FLOAT_EQ(no_return.value(), 8.19F);
}

TEST(NoReturn, OnceFoundItHoldsForScansWithFew) {
  NoReturn no_return;
  no_return.look(scanWith(8.19F, 70, 110));
  no_return.look(scanWith(8.19F, 90, 90));
  no_return.look(scanWith(5.0F, 90, 90));
  EXPECT_FLOAT_EQ(no_return.value(), 8.19F);
}

TEST(NoReturn, ALargerReadingRefutesIt) {
  NoReturn no_return;
  no_return.look(scanWith(8.19F, 70, 110));
  no_return.look(scanWith(8.2F, 90, 90));
  EXPECT_EQ(no_return.value(), kInfinity);
}

TEST(NoReturn, WallsInFrontOfTheArcAreNoMatter) {
  LaserScan scan = scanWith(8.19F, 70, 110);
  scan.ranges[75] = 3.0F;
  NoReturn no_return;
  no_return.look(scan);
  EXPECT_FLOAT_EQ(no_return.value(), 8.19F);
}

TEST(NoReturn, FarApartTheSameNumberMayBeChance) {
  LaserScan scan = scanWith(8.19F, 20, 23);
  for (std::size_t i = 150; i < 154; ++i) scan.ranges[i] = 8.19F;
  NoReturn no_return;
  no_return.look(scan);
  EXPECT_EQ(no_return.value(), kInfinity);
}

TEST(NoReturn, FewerThanFiveBeamsMayBeChance) {
  LaserScan scan = scanWith(8.19F, 10, 13);
  scan.angle_increment = 5.0 * kDegree;
  NoReturn no_return;
  no_return.look(scan);
  EXPECT_EQ(no_return.value(), kInfinity);
  scan.ranges[14] = 8.19F;
  no_return.look(scan);
  EXPECT_FLOAT_EQ(no_return.value(), 8.19F);
}

TEST(NoReturn, AWallIsNoArc) {
  for (const double rounding : {1e-3, 0.01, 0.05}) {
    for (const double distance : {0.5, 1.0, 2.0, 4.0, 8.0, 30.0}) {
      LaserScan scan = scanOfAWall(distance, rounding);
      for (std::size_t i = 60; i <= 120; ++i) {  // the nearest part of the wall alone, through a door
        if (scan.ranges[i] > scan.ranges[90]) scan.ranges[i] = 0.4F;
      }
      NoReturn no_return;
      no_return.look(scanOfAWall(distance, rounding));
      no_return.look(scan);
      EXPECT_EQ(no_return.value(), kInfinity) << distance << " m, rounded to " << rounding << " m";
    }
  }
}

TEST(NoReturn, WhatIsNoReadingAnywayIsNotLookedAt) {
  NoReturn no_return;
  for (const float range : {0.0F, -1.0F, 50.0F, 81.9F, std::numeric_limits<float>::infinity(), std::nanf("")}) {
    no_return.look(scanOf(range));
    no_return.look(scanWith(range, 70, 110));
    EXPECT_EQ(no_return.value(), kInfinity) << range;
  }
  LaserScan none = scanOf(8.0F);
  none.ranges.clear();
  no_return.look(none);
  EXPECT_EQ(no_return.value(), kInfinity);
}

TEST(NoReturn, ABlindLaserTellsItAlone) {
  NoReturn no_return;
  no_return.look(scanOf(8.19F));
  EXPECT_FLOAT_EQ(no_return.value(), 8.19F);
}

TEST(NoReturn, AnglesThatAreNoneTellNothing) {
  LaserScan scan = scanOf(8.19F);
  scan.angle_increment = std::nan("");
  NoReturn no_return;
  no_return.look(scan);
  EXPECT_EQ(no_return.value(), kInfinity);
}

}  // namespace
}  // namespace sckf
