// Odometry and scans in time: in any order, between samples, waiting, and what comes too late to be used.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>

#include "core/matrix_matchers.h"
#include "pipeline/simulated_drive.h"

namespace sckf::test {
namespace {

using Insertion = OdometryBuffer::Insertion;

/// What a scan that must not be used leaves behind: this outcome and a reason with these words, and no trace else.
void expectIgnored(Driven& driven, const LaserScan& scan, ScanOutcome outcome, const std::string& words) {
  const std::optional<Estimate> before = driven.pipeline.latest();
  const std::size_t reports = driven.reports.size();
  driven.scan(scan);
  ASSERT_EQ(driven.reports.size(), reports + 1);
  const ScanReport& report = driven.reports.back();
  EXPECT_EQ(report.stamp, scan.stamp);
  EXPECT_EQ(report.outcome, outcome) << toString(report.outcome);
  EXPECT_THAT(report.reason, testing::HasSubstr(words));
  EXPECT_FALSE(report.estimate);
  EXPECT_EQ(report.scan, nullptr);
  if (before) expectNear(*before, *driven.pipeline.latest(), 0.0);
}

// ---- order ----------------------------------------------------------------------------------------------------------

/// 30 ms and 0.7 m/s: taken at the sample before or after instead, the pose would be off by a centimetre.
TEST(ScanOdometryTime, InterpolatesTheWheelsAtTheScansStamp) {
  const SimulatedDrive drive;
  Driven driven(drive, withMethod("dead_reckoning"));
  for (int ms = 0; ms <= 6000; ++ms) {
    if (ms % 30 == 0) driven.odometry(ms);
    if (ms % 100 == 7) driven.scan(ms);
  }
  ASSERT_EQ(driven.reports.size(), 60U);
  for (const ScanReport& report : driven.reports) {
    const SE2 wheels = drive.wheels(milliseconds(report.stamp));
    const Eigen::Vector3d e = error(report.estimate.value().odom_from_base, wheels);
    EXPECT_LT(e.cwiseAbs().maxCoeff(), 2e-4) << "at " << milliseconds(report.stamp) << " ms: " << e.transpose();
  }
}

TEST(ScanOdometryTime, AScanWaitsForTheOdometryAfterIt) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.scan(27);  // before there is any odometry
  EXPECT_TRUE(driven.reports.empty());
  EXPECT_FALSE(driven.pipeline.latest());
  driven.odometry(0);
  driven.odometry(20);
  EXPECT_TRUE(driven.reports.empty());
  EXPECT_EQ(driven.pipeline.latest()->stamp, at(20));
  driven.odometry(40);
  ASSERT_EQ(driven.reports.size(), 1U);
  EXPECT_EQ(driven.reports[0].stamp, at(27));
  EXPECT_EQ(driven.reports[0].estimate->stamp, at(27));

  driven.scan(107);
  driven.scan(87);
  driven.odometry(60);
  driven.odometry(80);
  EXPECT_EQ(driven.reports.size(), 1U);
  driven.odometry(120);  // both, in their order
  ASSERT_EQ(driven.reports.size(), 3U);
  EXPECT_EQ(driven.reports[1].stamp, at(87));
  EXPECT_EQ(driven.reports[2].stamp, at(107));
}

TEST(ScanOdometryTime, AScanWithTheStampOfASampleWaitsForNoMore) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.odometry(0);
  driven.scan(0);
  ASSERT_EQ(driven.reports.size(), 1U);
  EXPECT_EQ(driven.reports[0].outcome, ScanOutcome::kReference);
  driven.odometry(20);
  driven.scan(20);
  ASSERT_EQ(driven.reports.size(), 2U);
  EXPECT_EQ(driven.reports[1].outcome, ScanOutcome::kUpdated);
}

/// Odometry and scans are mixed up within each 0.2 s; only the first sample, which defines the frame, comes first.
TEST(ScanOdometryTime, TheOrderOfArrivalDoesNotMatter) {
  const SimulatedDrive drive;
  Driven in_order(drive);
  in_order.odometry(0);
  in_order.run(0, 8000);

  Driven mixed(drive);
  mixed.odometry(0);
  std::mt19937_64 random(5);
  for (int begin = 0; begin < 8000; begin += 200) {
    std::vector<int> stamps;
    for (int ms = begin + 1; ms <= begin + 200; ++ms) {
      if (ms % 20 == 0 || ms % 100 == 7) stamps.push_back(ms);
    }
    std::shuffle(stamps.begin(), stamps.end(), random);
    for (const int ms : stamps) {
      if (ms % 20 == 0) {
        EXPECT_EQ(mixed.pipeline.addOdometry(drive.odometry(ms)), Insertion::kInserted) << ms;
      } else {
        mixed.pipeline.addScan(drive.scan(ms), drive.laser.base_from_laser);
      }
    }
    mixed.process();
  }
  ASSERT_EQ(mixed.reports.size(), in_order.reports.size());
  for (std::size_t i = 0; i < mixed.reports.size(); ++i) {
    EXPECT_EQ(mixed.reports[i].outcome, in_order.reports[i].outcome);
    expectNear(mixed.reports[i].estimate.value(), in_order.reports[i].estimate.value(), 0.0);
  }
}

/// Scans come 0.3 s later than the odometry of their time, as through a slow driver.
TEST(ScanOdometryTime, LateScansGiveTheSameEstimates) {
  const SimulatedDrive drive;
  Driven in_time(drive);
  Driven late(drive);
  for (int ms = 0; ms <= 8000; ++ms) {
    if (ms % 20 == 0) in_time.odometry(ms);
    if (ms % 20 == 0) late.odometry(ms);
    if (ms % 100 == 7) in_time.scan(ms);
    if (ms % 100 == 7 && ms >= 300) late.scan(ms - 300);
  }
  ASSERT_GE(late.reports.size(), 77U);
  for (std::size_t i = 0; i < late.reports.size(); ++i) {
    expectNear(late.reports[i].estimate.value(), in_time.reports[i].estimate.value(), 0.0);
  }
}

/// Three samples 1 ms apart, then nothing for 58 ms; jitter; and every sample twice.
TEST(ScanOdometryTime, BurstsJitterAndRepetitionOfOdometryDoNoHarm) {
  const SimulatedDrive drive;
  Driven driven(drive);
  std::mt19937_64 random(2);
  std::uniform_int_distribution<int> jitter(0, 15);
  for (int begin = 0; begin < 14900; begin += 60) {
    const int burst = begin == 0 ? 0 : begin + jitter(random);
    for (const int ms : {burst, burst + 1, burst + 2}) {
      driven.odometry(ms);
      EXPECT_EQ(driven.pipeline.addOdometry(drive.odometry(ms)), Insertion::kDuplicate);
    }
    if (begin % 120 == 0) driven.scan(begin + 30);
    if (begin > 500) {
      const Twist twist = driven.pipeline.latest()->twist;
      EXPECT_NEAR(twist.mean.x(), 0.5, 0.35) << "at " << burst << " ms";
      EXPECT_NEAR(twist.mean.y(), 0.0, 0.05) << "at " << burst << " ms";
    }
  }
  EXPECT_EQ(driven.count(ScanOutcome::kUpdated) + 1, driven.reports.size());
  expectAccurate(drive, driven);
}

// ---- what is not used -----------------------------------------------------------------------------------------------

TEST(ScanOdometryTime, AScanThatIsNotNewerIsOutOfOrder) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.odometry(0);
  driven.run(0, 1000);
  ASSERT_EQ(driven.reports.back().stamp, at(907));
  expectIgnored(driven, drive.scan(907), ScanOutcome::kOutOfOrder, "not newer than the estimate");
  expectIgnored(driven, drive.scan(906), ScanOutcome::kOutOfOrder, "0.906 s, that of the estimate ");
  EXPECT_THAT(driven.reports.back().reason, testing::EndsWith("0.907 s, 0.001 s later"));
  driven.run(1000, 1100);
  EXPECT_EQ(driven.reports.back().outcome, ScanOutcome::kUpdated);
}

TEST(ScanOdometryTime, AScanLongBeforeTheEstimateHasNoOdometry) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.odometry(0);
  driven.run(0, 1000);
  expectIgnored(driven, drive.scan(500), ScanOutcome::kNoOdometry, "older than the odometry");
}

TEST(ScanOdometryTime, AScanBeforeTheFirstOdometryHasNone) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.odometry(500);
  driven.odometry(520);
  expectIgnored(driven, drive.scan(499), ScanOutcome::kNoOdometry, "older than the odometry");
  EXPECT_THAT(driven.reports.back().reason, testing::HasSubstr("0.499 s, those of the odometry are "));
  EXPECT_THAT(driven.reports.back().reason, testing::EndsWith(", 0.001 s away"));
  driven.scan(507);
  EXPECT_EQ(driven.reports.back().outcome, ScanOutcome::kReference);
}

TEST(ScanOdometryTime, OfTooManyWaitingScansTheOldestAreGivenUp) {
  const SimulatedDrive drive;
  PipelineOptions options;
  options.max_waiting_scans = 3;
  Driven driven(drive, options);
  driven.odometry(0);
  driven.run(0, 100);
  const Estimate before = driven.pipeline.latest().value();
  driven.reports.clear();
  for (int ms = 107; ms <= 507; ms += 100) driven.scan(ms);
  ASSERT_EQ(driven.reports.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(driven.reports[i].stamp, at(107 + 100 * static_cast<int>(i)));
    EXPECT_EQ(driven.reports[i].outcome, ScanOutcome::kNoOdometry);
    EXPECT_THAT(driven.reports[i].reason, testing::HasSubstr("too many scans wait"));
    EXPECT_THAT(driven.reports[i].reason, testing::EndsWith("s away"));
    EXPECT_FALSE(driven.reports[i].estimate);
  }
  expectNear(before, *driven.pipeline.latest(), 0.0);
  for (int ms = 120; ms <= 520; ms += 20) driven.odometry(ms);
  EXPECT_EQ(driven.reports.size(), 5U);
  EXPECT_EQ(driven.count(ScanOutcome::kUpdated), 3U);
}

TEST(ScanOdometryTime, OdometryThatIsNotFiniteIsRefused) {
  const SimulatedDrive drive;
  Driven driven(drive);
  OdometrySample bad = drive.odometry(0);
  for (double* value : {&bad.odom_from_base.x, &bad.odom_from_base.y, &bad.odom_from_base.yaw}) {
    const double good = *value;
    for (const double wrong : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
      *value = wrong;
      bad.stamp += Stamp(1);
      EXPECT_EQ(driven.pipeline.addOdometry(bad), Insertion::kNotFinite);
      EXPECT_FALSE(driven.pipeline.latest());
    }
    *value = good;
  }
  driven.odometry(0);
  driven.run(0, 500);
  const Estimate before = driven.pipeline.latest().value();
  bad.stamp = at(510);
  bad.odom_from_base.x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(driven.pipeline.addOdometry(bad), Insertion::kNotFinite);
  expectNear(before, *driven.pipeline.latest(), 0.0);
  EXPECT_TRUE(matricesNear(before.twist.mean, driven.pipeline.latest()->twist.mean, 0.0));
  driven.run(500, 3000);
  expectAccurate(drive, driven);
}

TEST(ScanOdometryTime, OdometryBeforeTheLastScanIsTooOld) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.odometry(0);
  driven.run(0, 1000);
  const Estimate before = driven.pipeline.latest().value();
  EXPECT_EQ(driven.pipeline.addOdometry(drive.odometry(906)), Insertion::kTooOld);
  expectNear(before, *driven.pipeline.latest(), 0.0);
  EXPECT_EQ(driven.pipeline.addOdometry(drive.odometry(990)), Insertion::kInserted);
}

/// What lies more than max_scan_delay back is taken by the filter and forgotten, scans or not.
TEST(ScanOdometryTime, WithoutScansTheOdometryAtHandStaysShort) {
  const SimulatedDrive drive(Wheels(), 30000);
  PipelineOptions options;
  options.max_scan_delay = 1.0;
  Driven driven(drive, options);
  for (int ms = 0; ms <= 30000; ms += 20) {
    driven.odometry(ms);
    if (ms >= 1020) {
      ASSERT_EQ(driven.pipeline.addOdometry(drive.odometry(ms - 1001)), Insertion::kTooOld) << ms;
    }
  }
  EXPECT_LT(error(driven.pipeline.latest()->odom_from_base, drive.wheels(30000)).cwiseAbs().maxCoeff(), 1e-9);
  expectIgnored(driven, drive.scan(28999), ScanOutcome::kNoOdometry, "older than the odometry");
  driven.scan(29007);
  EXPECT_EQ(driven.reports.back().outcome, ScanOutcome::kReference);
}

// ---- stamps that are wrong ------------------------------------------------------------------------------------------

TEST(ScanOdometryTime, OdometryOfStampZeroOrBeforeTheFirstIsTooOld) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.odometry(500);
  OdometrySample sample = drive.odometry(0);
  EXPECT_EQ(driven.pipeline.addOdometry(sample), Insertion::kTooOld);
  sample.stamp = Stamp(0);
  EXPECT_EQ(driven.pipeline.addOdometry(sample), Insertion::kTooOld);
  EXPECT_EQ(driven.pipeline.latest()->stamp, at(500));
  driven.run(500, 2000);
  EXPECT_EQ(driven.count(ScanOutcome::kUpdated), 14U);
}

/// One sample from the future, and the next of now: the estimate does not follow it, and loses nothing.
TEST(ScanOdometryTime, OdometryFromTheFutureIsNotFollowed) {
  const SimulatedDrive drive;
  Driven undisturbed(drive);
  Driven driven(drive);
  for (Driven* each : {&undisturbed, &driven}) each->odometry(0);
  int ms = 0;
  for (const int ahead : {1100, 9000, 3600000}) {
    for (Driven* each : {&undisturbed, &driven}) each->run(ms, ms + 1000);
    ms += 1000;
    OdometrySample future = drive.odometry(ms);
    future.stamp = at(ms + ahead);
    EXPECT_EQ(driven.pipeline.addOdometry(future), Insertion::kAhead);
    driven.process();
    EXPECT_EQ(driven.pipeline.latest()->stamp, at(ms));
  }
  for (Driven* each : {&undisturbed, &driven}) each->run(ms, ms + 1000);
  ASSERT_EQ(driven.reports.size(), undisturbed.reports.size());
  for (std::size_t i = 0; i < driven.reports.size(); ++i) {
    expectNear(*driven.reports[i].estimate, *undisturbed.reports[i].estimate, 0.0);
  }
}

/// Samples farther apart than a scan may be late: each waits for the next one, and all are followed.
TEST(ScanOdometryTime, SparseOdometryIsFollowed) {
  const SimulatedDrive drive(Wheels(), 60000);
  Driven driven(drive);
  for (int ms = 0; ms <= 60000; ms += 6000) {
    driven.odometry(ms);
    const int confirmed = ms - ms % 12000;  // with every second sample the one before it
    ASSERT_EQ(driven.pipeline.latest()->stamp, at(confirmed));
    const Eigen::Vector3d e = error(driven.pipeline.latest()->odom_from_base, drive.wheels(confirmed));
    EXPECT_LT(e.cwiseAbs().maxCoeff(), 1e-9) << e.transpose() << " at " << ms;
  }
}

/// It waits for its time, and does not get into the way of others: not even if there are as many as may wait.
TEST(ScanOdometryTime, ScansFromTheFutureWaitForTheirTime) {
  const SimulatedDrive drive;
  PipelineOptions options;
  options.max_waiting_scans = 5;
  Driven driven(drive, options);
  driven.odometry(0);
  driven.run(0, 1000);
  for (int i = 0; i < 5; ++i) {
    LaserScan future = drive.scan(2000);
    future.stamp = at(900000 + i);
    driven.scan(future);
  }
  driven.run(1000, 3000);
  EXPECT_EQ(driven.count(ScanOutcome::kUpdated), 29U);
  EXPECT_LE(driven.pipeline.waitingScans(), 5U);
  for (const ScanReport& report : driven.reports) {
    if (report.outcome == ScanOutcome::kNoOdometry) {
      EXPECT_GE(report.stamp, at(900000));
    }
  }
  EXPECT_LT(driven.latestError(3000).head<2>().norm(), 0.04);
}

TEST(ScanOdometryTime, AStampThatIsNoTimeIsRefusedWithTheValue) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.odometry(0);
  driven.run(0, 1000);
  for (const Stamp none : {Stamp(-5000000000), Stamp::min(), Stamp::max()}) {
    LaserScan scan = drive.scan(1000);
    scan.stamp = none;
    expectIgnored(driven, scan, ScanOutcome::kUnusable, none == Stamp(-5000000000) ? "its stamp is -5 s" : "expected");
    OdometrySample sample = drive.odometry(1000);
    sample.stamp = none;
    EXPECT_EQ(driven.pipeline.addOdometry(sample), Insertion::kNotFinite);
  }
  LaserScan zero = drive.scan(1000);
  zero.stamp = Stamp(0);
  expectIgnored(driven, zero, ScanOutcome::kNoOdometry, "s away: are the clocks synchronised?");
}

/// Each scan three times: once used, twice out of order, and the estimate as if it had come once.
TEST(ScanOdometryTime, ARepeatedScanCountsOnce) {
  const SimulatedDrive drive;
  Driven once(drive);
  Driven thrice(drive);
  for (Driven* each : {&once, &thrice}) each->odometry(0);
  for (int ms = 1; ms <= 4000; ++ms) {
    for (Driven* each : {&once, &thrice}) {
      if (ms % 20 == 0) each->odometry(ms);
      for (int i = 0; i < (each == &thrice ? 3 : 1) && ms % 100 == 7; ++i) each->scan(ms);
    }
  }
  EXPECT_EQ(thrice.reports.size(), 3 * once.reports.size());
  EXPECT_EQ(thrice.count(ScanOutcome::kOutOfOrder), 2 * once.reports.size());
  EXPECT_EQ(thrice.count(ScanOutcome::kUpdated), once.count(ScanOutcome::kUpdated));
  expectNear(*thrice.pipeline.latest(), *once.pipeline.latest(), 0.0);
}

/// Whatever comes in whatever order with whatever loss: every scan is in one report, and the estimate never goes back.
struct Disorder {
  const char* name;
  int odometry_delay;  ///< [ms] at most
  int scan_delay;      ///< [ms] at most
  int lost;            ///< [%] of either
  int repeated;        ///< [%] of either
  double used;         ///< scans, of 129, at least
};
void PrintTo(const Disorder& disorder, std::ostream* os) { *os << disorder.name; }

class ScanOdometryDisorder : public ::testing::TestWithParam<Disorder> {};

TEST_P(ScanOdometryDisorder, EveryScanIsAccountedForAndTheEstimateIsGood) {
  const Disorder& disorder = GetParam();
  const SimulatedDrive drive;
  std::mt19937_64 random(7);
  const auto upTo = [&random](int limit) { return std::uniform_int_distribution<int>(0, limit)(random); };
  std::multimap<int, int> odometry;  // by the time of arrival
  std::multimap<int, int> scans;
  const auto send = [&](std::multimap<int, int>& messages, int ms, int delay) {
    if (upTo(99) < disorder.lost) return;
    messages.emplace(ms + upTo(delay), ms);
    if (upTo(99) < disorder.repeated) messages.emplace(ms + upTo(delay), ms);
  };
  for (int ms = 20; ms <= 14000; ms += 20) send(odometry, ms, disorder.odometry_delay);
  for (int ms = 107; ms <= 13000; ms += 100) send(scans, ms, disorder.scan_delay);

  Driven driven(drive);
  driven.odometry(0);
  Stamp last_published(0);
  for (int now = 0; now <= 15500; ++now) {
    for (auto [it, end] = odometry.equal_range(now); it != end; ++it) driven.odometry(it->second);
    for (auto [it, end] = scans.equal_range(now); it != end; ++it) driven.scan(it->second);
    EXPECT_GE(driven.pipeline.latest()->stamp, last_published);
    last_published = driven.pipeline.latest()->stamp;
  }
  EXPECT_EQ(driven.reports.size() + driven.pipeline.waitingScans(), scans.size());
  for (const ScanReport& report : driven.reports) {
    if (!report.estimate) continue;
    const Eigen::Vector3d e = error(report.estimate->odom_from_base, drive.truth(milliseconds(report.stamp)));
    EXPECT_LT(e.head<2>().norm(), 0.06) << "at " << milliseconds(report.stamp) << " ms: " << e.transpose();
  }
  const auto used = static_cast<double>(driven.count(ScanOutcome::kUpdated));
  EXPECT_GE(used, disorder.used);
}

INSTANTIATE_TEST_SUITE_P(Cases, ScanOdometryDisorder,
                         ::testing::Values(Disorder{"OdometryLate", 300, 0, 0, 0, 120},
                                           Disorder{"ScansLate", 0, 300, 0, 0, 85},
                                           Disorder{"BothLate", 150, 150, 0, 0, 120}, Disorder{"Lost", 0, 0, 30, 0, 85},
                                           Disorder{"Repeated", 20, 20, 0, 50, 120},
                                           Disorder{"All", 150, 150, 20, 30, 95}),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace sckf::test
