// Scans whose beams are measured one after the other, by a robot that turns.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "pipeline/simulated_drive.h"

namespace sckf::test {
namespace {

using ::testing::HasSubstr;

constexpr int kSweep = 72;  // [ms]

/// The round drive with the head turned to and fro, at up to 2.5 rad/s: what a sweep shifts, the next one shifts back.
SE2 swingingDrive(double t) {
  const SE2 pose = roundDrive(t);
  return {pose.x, pose.y, pose.yaw + 0.8 * std::sin(M_PI * t)};
}

class DeskewingTest : public ::testing::Test {
 protected:
  DeskewingTest() { drive.laser.time_increment = 1e-3 * kSweep / (drive.laser.beams - 1); }

  static PipelineOptions options(bool deskew) {
    PipelineOptions options;
    options.deskew = deskew;
    return options;
  }

  /// Root mean square of the errors at the scans: way [m], and yaw [rad].
  Eigen::Vector2d rms(const Driven& driven) const {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (const ScanReport& report : driven.reports) {
      const Eigen::Vector3d e = error(report.estimate.value().odom_from_base, drive.truth(milliseconds(report.stamp)));
      sum += Eigen::Vector2d(e.head<2>().squaredNorm(), e.z() * e.z());
    }
    return (sum / static_cast<double>(driven.reports.size())).cwiseSqrt();
  }

  /// Six seconds of the drive, with every scan changed before it comes.
  Driven driven(const PipelineOptions& options, const std::function<void(LaserScan&)>& change) const {
    Driven driven(drive, options);
    for (int ms = 0; ms <= 6000; ++ms) {
      if (ms % 20 == 0) driven.odometry(ms);
      if (ms % 100 != 7 || ms > 5900) continue;
      LaserScan scan = drive.scan(ms);
      change(scan);
      driven.scan(scan);
    }
    return driven;
  }

  SimulatedDrive drive{{}, 16000, room(), swingingDrive};
};

TEST_F(DeskewingTest, TakesAwayTheErrorThatTheMotionMakes) {
  const auto as_it_is = [](LaserScan&) {};
  const Driven with = driven(options(true), as_it_is);
  const Driven without = driven(options(false), as_it_is);
  ASSERT_EQ(with.reports.size(), 59U);
  ASSERT_EQ(without.reports.size(), 59U);
  for (const ScanReport& report : with.reports) EXPECT_EQ(report.deskewing, Deskewing::kDone);
  for (const ScanReport& report : without.reports) EXPECT_EQ(report.deskewing, Deskewing::kOff);
  EXPECT_LT(rms(with).x(), 0.015) << "m; without: " << rms(without).x();
  EXPECT_LT(rms(with).y(), 0.006) << "rad; without: " << rms(without).y();
  EXPECT_GT(rms(without).y(), 5.0 * rms(with).y());
}

TEST_F(DeskewingTest, AScanWaitsUntilItsEndIsCovered) {
  Driven driven(drive, options(true));
  driven.odometry(0);
  driven.scan(7);  // until 79 ms
  for (const int ms : {20, 40, 60}) driven.odometry(ms);
  EXPECT_EQ(driven.reports.size(), 0U);
  EXPECT_EQ(driven.pipeline.waitingScans(), 1U);
  driven.odometry(80);
  ASSERT_EQ(driven.reports.size(), 1U);
  EXPECT_EQ(driven.reports[0].estimate.value().stamp, at(7));
}

TEST_F(DeskewingTest, WithoutItAScanWaitsForItsStampAlone) {
  Driven driven(drive, options(false));
  driven.odometry(0);
  driven.scan(7);
  driven.odometry(20);
  EXPECT_EQ(driven.reports.size(), 1U);
}

TEST_F(DeskewingTest, AScanWithAWrongTimeIsUsedAsItIs) {
  const Driven plain = driven(options(false), [](LaserScan&) {});
  for (const double wrong : {0.0, -0.0002, 0.01, 0.0004, std::numeric_limits<double>::quiet_NaN(),
                             std::numeric_limits<double>::infinity(), std::numeric_limits<double>::max()}) {
    const Driven tried = driven(options(true), [wrong](LaserScan& scan) {
      const bool is_first = scan.stamp == at(7);  // before the second nothing tells how far scans are apart
      scan.time_increment = is_first ? -1.0 : wrong;
    });
    ASSERT_EQ(tried.reports.size(), plain.reports.size()) << wrong;
    for (std::size_t i = 1; i < plain.reports.size(); ++i) {
      const ScanReport& report = tried.reports[i];
      EXPECT_EQ(report.deskewing, wrong == 0.0 ? Deskewing::kNotTold : Deskewing::kRefused) << wrong;
      EXPECT_THAT(report.deskewing_problem, HasSubstr("time_increment is "));
      EXPECT_EQ(report.outcome, plain.reports[i].outcome);
      EXPECT_EQ(report.reason, plain.reports[i].reason);
      expectNear(*report.estimate, *plain.reports[i].estimate, 0.0);
    }
  }
}

TEST_F(DeskewingTest, WhereTheWheelsAreSilentTheMotionIsThatOfTheScans) {
  PipelineOptions alone = options(true);
  alone.scans_alone = true;
  alone.odometry_timeout = 0.3;
  Driven driven(drive, alone);
  driven.run(-1, 2000);
  driven.scansOnly(2000, 6000);
  driven.run(6000, 8000);
  EXPECT_EQ(driven.reports.size(), 80U) << "none is lost";
  for (const ScanReport& report : driven.reports) {
    EXPECT_EQ(report.deskewing, Deskewing::kDone);
    EXPECT_TRUE(report.estimate.has_value()) << milliseconds(report.stamp);
  }
  PipelineOptions skewed = alone;
  skewed.deskew = false;
  Driven without(drive, skewed);
  without.run(-1, 2000);
  without.scansOnly(2000, 6000);
  without.run(6000, 8000);
  EXPECT_LT(rms(driven).y(), 0.7 * rms(without).y()) << rms(driven).transpose() << "; " << rms(without).transpose();
}

TEST_F(DeskewingTest, WithoutAnyOdometryTheFirstScanIsNotLost) {
  PipelineOptions alone = options(true);
  alone.scans_alone = true;
  Driven driven(drive, alone);
  driven.scansOnly(0, 3000);
  EXPECT_GE(driven.reports.size(), 28U);
  for (const ScanReport& report : driven.reports) {
    EXPECT_TRUE(report.estimate.has_value()) << report.reason;
  }
  EXPECT_EQ(driven.reports.front().stamp, at(7));
}

TEST_F(DeskewingTest, TheOdometryThatAScanWaitsForIsKept) {
  PipelineOptions hasty = options(true);
  hasty.max_scan_delay = 0.03;  // less than a sweep
  Driven driven(drive, hasty);
  driven.run(-1, 3000);
  ASSERT_EQ(driven.reports.size(), 30U);
  for (const ScanReport& report : driven.reports) EXPECT_TRUE(report.estimate.has_value()) << report.reason;
}

TEST_F(DeskewingTest, CanBeSwitchedWhileItRuns) {
  Driven driven(drive, options(false));
  driven.run(-1, 1000);
  driven.pipeline.setOptions(options(true));
  driven.run(1000, 2000);
  driven.pipeline.setOptions(options(false));
  driven.run(2000, 3000);
  ASSERT_EQ(driven.reports.size(), 30U);
  for (std::size_t i = 0; i < 30; ++i) {
    EXPECT_EQ(driven.reports[i].deskewing, i / 10 == 1 ? Deskewing::kDone : Deskewing::kOff) << i;
  }
}

}  // namespace
}  // namespace sckf::test
