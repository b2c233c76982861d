// Wheels that fall silent, come back, and begin their frame anew.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/matrix_matchers.h"
#include "pipeline/simulated_drive.h"

namespace sckf::test {
namespace {

using Insertion = OdometryBuffer::Insertion;

PipelineOptions scansAlone(bool alone = true) {
  PipelineOptions options;
  options.scans_alone = alone;
  return options;
}

/// What the driver says that has begun its frame anew at an instant.
OdometrySample resetAt(const SimulatedDrive& drive, int reset, int ms) {
  OdometrySample sample = drive.odometry(ms);
  sample.odom_from_base = between(drive.odometry(reset).odom_from_base, sample.odom_from_base);
  return sample;
}

/// Looks at the estimate after every message: between two it must not move faster than a robot with the noise of scans.
class WithoutJumps {
 public:
  void look(const Driven& driven) {
    const std::optional<Estimate> now = driven.pipeline.latest();
    if (last_ && now) {
      const double dt = seconds(now->stamp - last_->stamp);
      const SE2 moved = between(last_->odom_from_base, now->odom_from_base);
      EXPECT_GE(dt, 0.0);
      EXPECT_LT(moved.translation().norm(), 0.8 * dt + 0.06) << "at " << milliseconds(now->stamp) << " ms";
      EXPECT_LT(std::abs(moved.yaw), 1.5 * dt + 0.06) << "at " << milliseconds(now->stamp) << " ms";
    }
    last_ = now;
  }

 private:
  std::optional<Estimate> last_;
};

// ---- jumps of the driver's frame ------------------------------------------------------------------------------------

TEST(ScanOdometryJumps, AResetOfTheDriversFrameIsNoMotion) {
  const SimulatedDrive drive;
  Driven driven(drive);
  WithoutJumps jumps;
  driven.odometry(0);
  for (int ms = 1; ms <= 10000; ++ms) {
    if (ms % 20 == 0) driven.pipeline.addOdometry(ms < 5010 ? drive.odometry(ms) : resetAt(drive, 5010, ms));
    if (ms % 100 == 7) driven.scan(ms);
    driven.process();
    jumps.look(driven);
  }
  EXPECT_EQ(driven.pipeline.odometryJumps(), 1U);
  EXPECT_EQ(driven.count(ScanOutcome::kUpdated), 99U);
  for (const ScanReport& report : driven.reports) {
    EXPECT_EQ(report.wheels_known, milliseconds(report.stamp) != 5007 && milliseconds(report.stamp) != 5107)
        << "at " << milliseconds(report.stamp);
  }
  expectAccurate(drive, driven);
}

/// Without scans to correct it the estimate goes on as it did, and says that it is less certain.
TEST(ScanOdometryJumps, TheEstimateGoesOnAtItsVelocityAndLessCertain) {
  const SimulatedDrive drive;
  PipelineOptions options;
  Driven driven(drive, options);
  for (int ms = 0; ms <= 1000; ms += 20) driven.odometry(ms);
  const Estimate before = driven.pipeline.latest().value();
  OdometrySample jumped = drive.odometry(1100);
  jumped.odom_from_base = SE2(-100, 100, 1);
  driven.pipeline.addOdometry(jumped);
  const Estimate after = driven.pipeline.latest().value();
  const Eigen::Vector3d off = error(after.odom_from_base, drive.wheels(1100));
  EXPECT_LT(off.cwiseAbs().maxCoeff(), 0.02) << off.transpose();
  EXPECT_TRUE(matricesNear(after.twist.mean, before.twist.mean, 0.0));
  const double std = options.motion.unknown_speed_std * 0.1;
  EXPECT_GT(after.covariance(0, 0), before.covariance(0, 0) + 0.99 * std * std);
  // And from the jumped sample on by the wheels again.
  OdometrySample next = drive.odometry(1120);
  next.odom_from_base = compose(jumped.odom_from_base, between(drive.wheels(1100), drive.wheels(1120)));
  driven.pipeline.addOdometry(next);
  const SE2 step = between(after.odom_from_base, driven.pipeline.latest()->odom_from_base);
  const SE2 wheels = between(drive.wheels(1100), drive.wheels(1120));
  EXPECT_LT(error(step, wheels).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_EQ(driven.pipeline.odometryJumps(), 1U);
}

TEST(ScanOdometryJumps, ASingleWildSampleIsNotFollowed) {
  const SimulatedDrive drive;
  Driven driven(drive);
  WithoutJumps jumps;
  driven.odometry(0);
  for (int ms = 1; ms <= 6000; ++ms) {
    if (ms % 20 == 0) {
      OdometrySample sample = drive.odometry(ms);
      if (ms % 1000 == 500) sample.odom_from_base.x += 50.0;
      driven.pipeline.addOdometry(sample);
    }
    if (ms % 100 == 7) driven.scan(ms);
    driven.process();
    jumps.look(driven);
  }
  EXPECT_EQ(driven.pipeline.odometryJumps(), 12U) << "there and back";
  expectAccurate(drive, driven);
}

// ---- silence --------------------------------------------------------------------------------------------------------

constexpr int kSilentFrom = 3000;

struct Silence {
  const char* name;
  bool scans_alone;
  bool reset;
  int until;
};
void PrintTo(const Silence& silence, std::ostream* os) { *os << silence.name; }

class ScanOdometrySilence : public ::testing::TestWithParam<Silence> {};

TEST_P(ScanOdometrySilence, IsOvercomeWithoutAJump) {
  const Silence& silence = GetParam();
  const SimulatedDrive drive;
  Driven driven(drive, scansAlone(silence.scans_alone));
  WithoutJumps jumps;
  driven.odometry(0);
  for (int ms = 1; ms <= 13000; ++ms) {
    const bool silent = ms > kSilentFrom && ms < silence.until;
    const bool reset = silence.reset && ms >= silence.until;
    if (ms % 20 == 0 && !silent) {
      driven.pipeline.addOdometry(reset ? resetAt(drive, silence.until, ms) : drive.odometry(ms));
    }
    if (ms % 100 == 7) driven.scan(ms);
    driven.process();
    jumps.look(driven);
    if (ms == kSilentFrom + 1000 || ms == kSilentFrom + 1250 || ms == silence.until + 100) {
      EXPECT_EQ(driven.pipeline.onScansAlone(), ms == kSilentFrom + 1250) << ms;
    }
    if (ms == silence.until - 20) {
      EXPECT_TRUE(driven.pipeline.onScansAlone());
      const int newest = milliseconds(driven.pipeline.latest()->stamp);
      EXPECT_EQ(newest, silence.scans_alone ? driven.reports.back().stamp == at(newest) ? newest : -1 : kSilentFrom);
    }
  }
  EXPECT_EQ(driven.reports.size(), 130U);
  EXPECT_EQ(driven.pipeline.odometryJumps(), silence.scans_alone || silence.reset ? 1U : 0U);
  const int last_unknown = silence.until + 100;
  for (const ScanReport& report : driven.reports) {
    const int ms = milliseconds(report.stamp);
    const bool bridged = silence.scans_alone || silence.reset;
    EXPECT_EQ(report.wheels_known, !bridged || ms < kSilentFrom || ms > last_unknown) << "at " << ms;
  }
  expectAccurate(drive, driven, 0.06);
}

INSTANTIATE_TEST_SUITE_P(Cases, ScanOdometrySilence,
                         ::testing::Values(Silence{"ScansAloneGoingOn", true, false, 8000},
                                           Silence{"ScansAloneReset", true, true, 8000},
                                           Silence{"WaitingGoingOn", false, false, 5000},
                                           Silence{"WaitingReset", false, true, 5000}),
                         [](const auto& info) { return info.param.name; });

TEST(ScanOdometrySilence, TheTwistOfScansAloneIsTheEstimatesOwn) {
  const SimulatedDrive drive;
  Driven driven(drive, scansAlone());
  driven.odometry(0);
  driven.run(0, kSilentFrom);
  driven.scansOnly(kSilentFrom, 12000);
  double squares = 0.0;
  int count = 0;
  for (const ScanReport& report : driven.reports) {
    const int ms = milliseconds(report.stamp);
    if (ms < kSilentFrom + 500) continue;
    const SE2 motion = between(drive.truth(ms - 200), drive.truth(ms));
    const Twist& twist = report.estimate->twist;
    const Eigen::Vector3d truth(motion.translation().norm() / 0.2, 0.0, motion.yaw / 0.2);
    const Eigen::Vector3d e = twist.mean - truth;
    EXPECT_LT(std::abs(e.x()), 0.15) << "at " << ms;
    EXPECT_LT(std::abs(e.z()), 0.15) << "at " << ms;
    squares += e.x() * e.x() / twist.covariance(0, 0);
    ++count;
  }
  ASSERT_GT(count, 80);
  EXPECT_LT(squares / count, 3.0) << "worse than it says";
  EXPECT_GT(squares / count, 0.02) << "far better than it says";
}

/// Each scan that is used tells the motion anew: what is guessed up to the next one is of 0.1 s, not of the whole
/// silence.
TEST(ScanOdometrySilence, TheGuessBeginsAnewAtEachScanThatIsUsed) {
  const SimulatedDrive drive;
  PipelineOptions options = scansAlone();
  options.reference.kf_dist_linear = options.reference.kf_dist_angular = 0.0;  // the prediction is from scan to scan
  Driven driven(drive, options);
  driven.odometry(0);
  driven.run(0, kSilentFrom);
  driven.scansOnly(kSilentFrom, 9000);
  for (const ScanReport& report : driven.reports) {
    const int ms = milliseconds(report.stamp);
    if (ms < kSilentFrom + 500) continue;
    const SE2 truth = between(drive.truth(ms - 100), drive.truth(ms));
    const Eigen::Vector3d e = error(report.prediction.reference_from_current, truth);
    EXPECT_LT(e.head<2>().norm(), 0.03) << "at " << ms << " ms: " << e.transpose();
    EXPECT_NEAR(std::sqrt(report.prediction.covariance(0, 0)), 0.1 * options.motion.unknown_speed_std, 0.01);
    EXPECT_NEAR(std::sqrt(report.prediction.covariance(2, 2)), 0.1 * options.motion.unknown_yaw_rate_std, 0.01);
  }
}

/// Late, but not silent: as soon as odometry comes again, scans wait for it instead of running ahead of it for ever.
TEST(ScanOdometrySilence, ScansWaitAgainForWheelsThatComeBackLate) {
  const SimulatedDrive drive;
  Driven driven(drive, scansAlone());
  driven.odometry(0);
  driven.run(0, kSilentFrom);
  driven.scansOnly(kSilentFrom, 6000);
  ASSERT_TRUE(driven.pipeline.onScansAlone());
  constexpr int kLatency = 250;
  for (int ms = 6001; ms <= 12000; ++ms) {
    if (ms % 20 == 0) {
      const Insertion insertion = driven.pipeline.addOdometry(drive.odometry(ms - kLatency + kLatency % 20));
      EXPECT_EQ(insertion, ms < 6260 ? Insertion::kTooOld : Insertion::kInserted) << ms;
    }
    if (ms % 100 == 7) driven.scan(ms);
    driven.process();
    EXPECT_EQ(driven.pipeline.onScansAlone(), ms < 6020) << ms;
  }
  EXPECT_TRUE(driven.reports.back().wheels_known);
  expectAccurate(drive, driven, 0.06);
}

/// A person covers the laser while the wheels are silent: nothing is known, which the covariance says, until it is
/// seen.
TEST(ScanOdometrySilence, WithNeitherWheelsNorScansNothingIsClaimed) {
  const SimulatedDrive drive;
  Driven driven(drive, scansAlone());
  driven.odometry(0);
  driven.run(0, kSilentFrom);
  driven.scansOnly(kSilentFrom, 4500);
  const Estimate before = driven.pipeline.latest().value();
  for (int ms = 4507; ms <= 9507; ms += 100) {
    LaserScan blind = drive.scan(ms);
    for (float& range : blind.ranges) range = std::numeric_limits<float>::infinity();
    driven.scan(blind);
  }
  EXPECT_EQ(driven.count(ScanOutcome::kUnusable), 51U);
  const Estimate after = driven.pipeline.latest().value();
  EXPECT_EQ(after.stamp, at(9507));
  const SE2 moved = between(before.odom_from_base, after.odom_from_base);
  EXPECT_LT(moved.translation().norm(), 1.0) << "a robot that nobody sees is not sent on for ever";
  EXPECT_GT(std::sqrt(after.covariance(0, 0)), 1.0);
  const Eigen::Vector3d e = error(after.odom_from_base, drive.truth(9507));
  EXPECT_LT(e.dot(after.covariance.inverse() * e), 16.0) << e.transpose();
}

TEST(ScanOdometrySilence, WithoutAnyWheelsScansAreTheOdometry) {
  const SimulatedDrive drive;
  Driven driven(drive, scansAlone());
  driven.scansOnly(0, 1250);
  EXPECT_FALSE(driven.pipeline.latest()) << "wheels may still come";
  EXPECT_TRUE(driven.reports.empty());
  driven.scansOnly(1250, 12000);
  ASSERT_EQ(driven.reports.size(), 120U);
  EXPECT_EQ(driven.count(ScanOutcome::kUpdated), 119U);
  EXPECT_TRUE(driven.pipeline.onScansAlone());
  const SE2 start = drive.truth(7);
  for (const ScanReport& report : driven.reports) {
    EXPECT_EQ(report.wheels_known, report.stamp == at(7));
    const SE2 truth = between(start, drive.truth(milliseconds(report.stamp)));
    const Eigen::Vector3d e = error(report.estimate.value().odom_from_base, truth);
    EXPECT_LT(e.head<2>().norm(), 0.05) << "at " << milliseconds(report.stamp) << " ms: " << e.transpose();
    EXPECT_LT(std::abs(e.z()), 0.02) << "at " << milliseconds(report.stamp) << " ms: " << e.transpose();
  }
  driven.run(12000, 14000);  // and now they come
  EXPECT_FALSE(driven.pipeline.onScansAlone());
  EXPECT_EQ(driven.pipeline.odometryJumps(), 1U);
  EXPECT_TRUE(driven.reports.back().wheels_known);
}

TEST(ScanOdometrySilence, WithoutAnyWheelsAllWaitsUnlessScansMayGoAlone) {
  const SimulatedDrive drive;
  Driven driven(drive, scansAlone(false));
  driven.scansOnly(0, 8000);
  EXPECT_FALSE(driven.pipeline.latest());
  EXPECT_TRUE(driven.pipeline.onScansAlone());
  EXPECT_EQ(driven.reports.size(), 30U);
  EXPECT_EQ(driven.count(ScanOutcome::kNoOdometry), 30U);
}

/// Dead reckoning has nothing to go by when the wheels are silent.
TEST(ScanOdometrySilence, DeadReckoningWaits) {
  const SimulatedDrive drive;
  PipelineOptions options = scansAlone();
  options.method = "dead_reckoning";
  Driven driven(drive, options);
  driven.odometry(0);
  driven.run(0, kSilentFrom);
  driven.scansOnly(kSilentFrom, 6000);
  EXPECT_EQ(driven.pipeline.latest()->stamp, at(kSilentFrom));
}

TEST(ScanOdometrySilence, EveryOtherMethodCarriesOnAlone) {
  const SimulatedDrive drive;
  for (const std::string& method : fusionMethodNames()) {
    if (method == "dead_reckoning") continue;
    SCOPED_TRACE(method);
    PipelineOptions options = scansAlone();
    options.method = method;
    Driven driven(drive, options);
    driven.odometry(0);
    driven.run(0, kSilentFrom);
    driven.scansOnly(kSilentFrom, 6000);
    driven.run(6000, 8000);
    expectAccurate(drive, driven, 0.08);
  }
}

/// One scan from the future says nothing about the wheels.
TEST(ScanOdometrySilence, AScanFromTheFutureIsNoSilence) {
  const SimulatedDrive drive;
  Driven driven(drive, scansAlone());
  driven.odometry(0);
  driven.run(0, 1000);
  driven.scan(drive.scan(14000));
  EXPECT_FALSE(driven.pipeline.onScansAlone());
  driven.run(1000, 3000);
  expectAccurate(drive, driven);
  EXPECT_EQ(driven.reports.size(), 30U);
  driven.scansOnly(3000, 6000);  // real silence: on alone, but not into the future
  EXPECT_TRUE(driven.pipeline.onScansAlone());
  EXPECT_EQ(driven.pipeline.latest()->stamp, at(5907));
  EXPECT_EQ(driven.reports.size(), 60U);
}

}  // namespace
}  // namespace sckf::test
