#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "sckf_odometry/pipeline/sweep.h"

namespace sckf {
namespace {

using ::testing::HasSubstr;

/// 361 beams.
LaserScan scanAt(int ms, double time_increment) {
  LaserScan scan;
  scan.stamp = std::chrono::seconds(1000) + std::chrono::milliseconds(ms);
  scan.time_increment = time_increment;
  scan.ranges.assign(361, 1.0F);
  return scan;
}

TEST(SweepCheck, LastsFromTheFirstBeamToTheLast) {
  const Sweep sweep = SweepCheck().check(scanAt(0, 0.0001));
  EXPECT_EQ(sweep.deskewing, Deskewing::kDone);
  EXPECT_NEAR(seconds(sweep.duration), 0.036, 1e-9);
  EXPECT_EQ(sweep.problem, "");
}

TEST(SweepCheck, OfLessThanTwoBeamsThereIsNothingToUndo) {
  LaserScan scan = scanAt(0, 5.0);
  scan.ranges.resize(1);
  EXPECT_EQ(SweepCheck().check(scan).deskewing, Deskewing::kOff);
  scan.ranges.clear();
  EXPECT_EQ(SweepCheck().check(scan).deskewing, Deskewing::kOff);
  EXPECT_EQ(SweepCheck().check(scan).duration, Stamp(0));
}

TEST(SweepCheck, ZeroIsADriverThatDoesNotTell) {
  const Sweep sweep = SweepCheck().check(scanAt(0, 0.0));
  EXPECT_EQ(sweep.deskewing, Deskewing::kNotTold);
  EXPECT_EQ(sweep.duration, Stamp(0));
  EXPECT_EQ(sweep.problem, "time_increment is 0 s: the time from one beam to the next expected");
}

TEST(SweepCheck, RefusesWhatIsNoTime) {
  for (const auto& [value, text] : std::vector<std::pair<double, std::string>>{
           {-0.0001, "time_increment is -0.0001 s: a finite time above 0 expected"},
           {std::numeric_limits<double>::quiet_NaN(), "time_increment is nan s: a finite time above 0 expected"},
           {std::numeric_limits<double>::infinity(), "time_increment is inf s: a finite time above 0 expected"},
           {-std::numeric_limits<double>::infinity(), "time_increment is -inf s: a finite"}}) {
    const Sweep sweep = SweepCheck().check(scanAt(0, value));
    EXPECT_EQ(sweep.deskewing, Deskewing::kRefused);
    EXPECT_EQ(sweep.duration, Stamp(0));
    EXPECT_THAT(sweep.problem, HasSubstr(text));
  }
}

TEST(SweepCheck, RefusesWhatNoLaserTakes) {
  const Sweep sweep = SweepCheck().check(scanAt(0, 0.1));
  EXPECT_EQ(sweep.deskewing, Deskewing::kRefused);
  EXPECT_EQ(sweep.problem, "time_increment is 0.1 s, which makes 36 s of 361 beams: at most 1 s expected");
  EXPECT_EQ(SweepCheck().check(scanAt(0, std::numeric_limits<double>::max())).deskewing, Deskewing::kRefused);
}

TEST(SweepCheck, RefusesWhatTakesLongerThanFromScanToScan) {
  SweepCheck sweeps;
  sweeps.check(scanAt(0, 0.001));
  const Sweep sweep = sweeps.check(scanAt(100, 0.001));
  EXPECT_EQ(sweep.deskewing, Deskewing::kRefused);
  EXPECT_EQ(sweep.problem,
            "time_increment is 0.001 s, which makes 0.36 s of 361 beams: at most the 0.1 s from scan to scan expected");
}

TEST(SweepCheck, ALaserThatTurnsAllTheTimeMayJitter) {
  SweepCheck sweeps;
  for (const int ms : {0, 95, 200, 296, 400}) {
    EXPECT_EQ(sweeps.check(scanAt(ms, 0.1 / 361)).deskewing, Deskewing::kDone) << ms;
  }
}

TEST(SweepCheck, BurstsAndRepeatedOrLateScansDoNotMakeItWrong) {
  SweepCheck sweeps;
  for (const int ms : {0, 100, 101, 101, 300, 301, 200, 400}) {
    EXPECT_EQ(sweeps.check(scanAt(ms, 0.0002)).deskewing, Deskewing::kDone) << ms;
  }
}

TEST(SweepCheck, AGapOfLongAgoIsForgotten) {
  SweepCheck sweeps;
  sweeps.check(scanAt(0, 0.001));
  for (int i = 0; i < 5; ++i) EXPECT_EQ(sweeps.check(scanAt(5000 + 100 * i, 0.001)).deskewing, Deskewing::kDone);
  EXPECT_EQ(sweeps.check(scanAt(5500, 0.001)).deskewing, Deskewing::kRefused);
}

}  // namespace
}  // namespace sckf
