// Where the estimate starts, setting its pose, and changing options while it runs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <limits>
#include <stdexcept>

#include "core/matrix_matchers.h"
#include "core/random_inputs.h"
#include "pipeline/simulated_drive.h"

namespace sckf::test {
namespace {

const SE2 kElsewhere(12.0, -7.0, 2.5);
const Eigen::Matrix3d kCovariance = Eigen::Vector3d(0.04, 0.09, 0.01).asDiagonal();

std::string refusalOf(const SE2& pose, const Eigen::Matrix3d& covariance) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.odometry(0);
  driven.run(0, 500);
  const Estimate before = driven.pipeline.latest().value();
  try {
    driven.pipeline.setPose(pose, covariance, at(500));
  } catch (const std::invalid_argument& refusal) {
    expectNear(*driven.pipeline.latest(), before, 0.0);
    EXPECT_THROW(ScanOdometry({}, pose, covariance), std::invalid_argument);
    return refusal.what();
  }
  return "not refused";
}

TEST(ScanOdometryState, APoseThatIsNoneIsRefusedByNameAndValue) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(refusalOf(SE2(1, nan, 0), kCovariance), testing::HasSubstr("pose is (1, nan, 0): expected finite"));
  Eigen::Matrix3d bad = kCovariance;
  bad(1, 1) = -0.5;
  EXPECT_THAT(refusalOf(kElsewhere, bad),
              testing::HasSubstr("[0.04, 0, 0; 0, -0.5, 0; 0, 0, 0.01]: expected a symmetric, positive semi-definite"));
  EXPECT_THAT(refusalOf(kElsewhere, 1e12 * kCovariance), testing::HasSubstr("finite values up to 1e+09"));
  EXPECT_THAT(refusalOf(SE2(0, 1e10, 0), kCovariance), testing::HasSubstr("values up to 1e+09"));
  bad = kCovariance;
  bad(0, 2) = 0.01;
  EXPECT_THAT(refusalOf(kElsewhere, bad), testing::HasSubstr("symmetric"));
  bad(0, 2) = nan;
  EXPECT_THAT(refusalOf(kElsewhere, bad), testing::HasSubstr("nan"));
}

TEST(ScanOdometryState, AYawThatIsNotKnownErrsByATurnAtMost) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.odometry(0);
  Eigen::Matrix3d unknown = 1e6 * Eigen::Matrix3d::Identity();  // as people send it
  unknown(0, 2) = unknown(2, 0) = 5e5;
  driven.pipeline.setPose(kElsewhere, unknown, at(0));
  const Eigen::Matrix3d P = driven.pipeline.latest()->covariance;
  EXPECT_NEAR(std::sqrt(P(2, 2)), 6.28, 1e-9);
  EXPECT_NEAR(P(0, 2) / std::sqrt(P(0, 0) * P(2, 2)), 0.5, 1e-9) << "the correlation stays";
  EXPECT_NEAR(P(0, 0), 1e6, 1e-3);
}

// ---- start ----------------------------------------------------------------------------------------------------------

TEST(ScanOdometryState, StartsWhereItIsTold) {
  const SimulatedDrive drive;
  Driven origin(drive);
  Driven elsewhere(drive, {}, kElsewhere, kCovariance);
  for (Driven* driven : {&origin, &elsewhere}) driven->odometry(0);
  EXPECT_TRUE(matricesNear(elsewhere.pipeline.latest()->odom_from_base.vector(), kElsewhere.vector(), 0.0));
  EXPECT_TRUE(matricesNear(elsewhere.pipeline.latest()->covariance, kCovariance, 0.0));
  for (Driven* driven : {&origin, &elsewhere}) driven->run(0, 3000);
  const SE2 expected = compose(kElsewhere, origin.pipeline.latest()->odom_from_base);
  const Eigen::Vector3d e = error(elsewhere.pipeline.latest()->odom_from_base, expected);
  EXPECT_LT(e.cwiseAbs().maxCoeff(), 0.01) << e.transpose();
}

TEST(ScanOdometryState, APoseSetBeforeTheFirstOdometryIsTheStart) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.pipeline.setPose(kElsewhere, kCovariance, Stamp(0));
  EXPECT_FALSE(driven.pipeline.latest());
  driven.odometry(0);
  EXPECT_TRUE(matricesNear(driven.pipeline.latest()->odom_from_base.vector(), kElsewhere.vector(), 0.0));
  EXPECT_TRUE(matricesNear(driven.pipeline.latest()->covariance, kCovariance, 0.0));
}

// ---- set pose -------------------------------------------------------------------------------------------------------

/// What an estimate says that was begun at that pose and instant, and knows nothing of what was before.
TEST(ScanOdometryState, AfterSettingThePoseNothingIsLeftOfBefore) {
  const SimulatedDrive drive;
  for (const std::string& method : fusionMethodNames()) {
    SCOPED_TRACE(method);
    constexpr int kInstant = 4020;
    PipelineOptions options = withMethod(method);
    options.calibration = noCalibration();  // what is found of wheels and laser stays, see below
    options.range_offset_std = options.sweep_duration_std = 0.0;
    Driven set(drive, options);
    set.odometry(0);
    set.run(0, 4060);
    set.pipeline.setPose(kElsewhere, kCovariance, at(kInstant));
    Driven fresh(drive, options, kElsewhere, kCovariance);
    for (const int ms : {kInstant, 4040, 4060}) fresh.odometry(ms);
    EXPECT_EQ(set.pipeline.latest()->stamp, at(4060));
    expectNear(*set.pipeline.latest(), *fresh.pipeline.latest(), 1e-12);
    const std::size_t before = set.reports.size();
    for (Driven* driven : {&set, &fresh}) driven->run(4060, 8000);
    ASSERT_EQ(set.reports.size(), before + fresh.reports.size());
    EXPECT_EQ(set.reports[before].outcome, ScanOutcome::kReference) << "the reference of before says nothing now";
    for (std::size_t i = 0; i < fresh.reports.size(); ++i) {
      EXPECT_EQ(set.reports[before + i].outcome, fresh.reports[i].outcome) << i;
      expectNear(*set.reports[before + i].estimate, *fresh.reports[i].estimate, 1e-9);
    }
  }
}

/// It has nothing to do with where the robot is.
TEST(ScanOdometryState, WhatWasFoundOfWheelsGyroAndLaserStays) {
  SimulatedDrive drive;
  drive.laser.noise = 0.01;
  drive.laser.offset = 0.02;
  PipelineOptions options;
  options.range_offset_std = 0.05;
  Driven set(drive, options);
  set.odometry(0);
  set.run(0, 10000);
  const ScanReport before = set.reports.back();
  ASSERT_GT(before.laser_constants.range_offset.variance(), 0.0);
  ASSERT_LT(before.calibration.covariance(0, 0), 0.7 * std::pow(options.calibration.distance_std, 2));
  Driven next(drive, options);  // as after a pause
  next.pipeline = ScanOdometry(options, kElsewhere, kCovariance, set.pipeline.found());
  set.pipeline.setPose(kElsewhere, kCovariance, at(10000));
  next.odometry(10000);
  for (Driven* driven : {&set, &next}) {
    driven->run(10000, 10100);
    const ScanReport& after = driven->reports.back();
    WheelCalibration expected = before.calibration;
    if (driven == &set) {
      expected = expected.turnedWithTheRobot(kElsewhere.yaw - before.estimate->odom_from_base.yaw);
    }
    EXPECT_TRUE(matricesNear(after.calibration.error, expected.error, 1e-4));
    EXPECT_TRUE(matricesClose(after.calibration.covariance.diagonal(), expected.covariance.diagonal(), 0.01));
    EXPECT_EQ(after.laser_constants.range_offset.value(), before.laser_constants.range_offset.value());
    EXPECT_EQ(after.laser_constants.sweep_duration.value(), before.laser_constants.sweep_duration.value());
  }
}

/// The robot was at the pose at the stamp, between two samples, and has moved on by the wheels since.
TEST(ScanOdometryState, ThePoseHoldsAtItsStamp) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.odometry(0);
  driven.run(0, 3000);
  driven.odometry(3020);
  driven.odometry(3100);
  EXPECT_TRUE(driven.pipeline.setPose(kElsewhere, kCovariance, at(3050)));
  const SE2 moved = between(kElsewhere, driven.pipeline.latest()->odom_from_base);
  const Eigen::Vector3d e = error(moved, between(drive.wheels(3050), drive.wheels(3100)));
  EXPECT_LT(e.cwiseAbs().maxCoeff(), 2e-3) << e.transpose();
  EXPECT_GT(driven.pipeline.latest()->covariance(0, 0), kCovariance(0, 0));
}

/// As a pose that a person gives, or another node after some computing: the robot has driven and scanned since.
TEST(ScanOdometryState, APoseOfBeforeTheLastScanIsBroughtForward) {
  const SimulatedDrive drive;
  for (const int ms : {1500, 3007}) {  // between scans, and at the last one
    Driven driven(drive);
    driven.odometry(0);
    driven.run(0, 3020);
    EXPECT_TRUE(driven.pipeline.setPose(kElsewhere, kCovariance, at(ms)));
    EXPECT_EQ(driven.pipeline.latest()->stamp, at(3020));
    const SE2 moved = between(kElsewhere, driven.pipeline.latest()->odom_from_base);
    const Eigen::Vector3d e = error(moved, between(drive.truth(ms), drive.truth(3020)));
    EXPECT_LT(e.cwiseAbs().maxCoeff(), 0.02) << ms << ": " << e.transpose();
    EXPECT_GT(driven.pipeline.latest()->covariance(0, 0), kCovariance(0, 0));
    // The next one, of before the one before was told.
    driven.run(3020, 3220);
    driven.pipeline.setPose(kElsewhere, kCovariance, at(2900));
    const SE2 moved_again = between(kElsewhere, driven.pipeline.latest()->odom_from_base);
    const Eigen::Vector3d again = error(moved_again, between(drive.truth(2900), drive.truth(3220)));
    EXPECT_LT(again.cwiseAbs().maxCoeff(), 0.02) << ms << ": " << again.transpose();
  }
}

/// The way since is that of the wheels, not a straight line from scan to scan, and what the scan has corrected.
TEST(ScanOdometryState, APoseOfBetweenScansFarApartIsBroughtForwardByTheWheels) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.odometry(0);
  driven.run(0, 1000);
  for (int ms = 1020; ms <= 4000; ms += 20) driven.pipeline.addOdometry(drive.odometry(ms));
  driven.pipeline.addScan(drive.scan(3990), drive.laser.base_from_laser);
  driven.process();
  driven.pipeline.setPose(kElsewhere, kCovariance, at(2500));
  const SE2 moved = between(kElsewhere, driven.pipeline.latest()->odom_from_base);
  const Eigen::Vector3d e = error(moved, between(drive.wheels(2500), drive.wheels(4000)));
  EXPECT_LT(e.cwiseAbs().maxCoeff(), 0.1) << e.transpose();
}

/// A stamp of zero, one that is long past, one from the future: none of which the motion is at hand.
TEST(ScanOdometryState, WithoutMotionSinceItsStampThePoseHoldsNow) {
  const SimulatedDrive drive;
  for (const Stamp stamp : {Stamp(0), at(-5000), at(3050), at(900000)}) {
    Driven driven(drive);
    driven.odometry(0);
    driven.run(0, 3020);
    const bool is_now = stamp == at(3050);  // but for what the wheels are late
    EXPECT_EQ(driven.pipeline.setPose(kElsewhere, kCovariance, stamp), is_now);
    EXPECT_EQ(driven.pipeline.latest()->stamp, at(3020));
    EXPECT_TRUE(matricesNear(driven.pipeline.latest()->odom_from_base.vector(), kElsewhere.vector(), 0.0));
    EXPECT_TRUE(matricesNear(driven.pipeline.latest()->covariance, kCovariance, 0.0));
    driven.run(3020, 3300);
    EXPECT_EQ(driven.reports.back().outcome, ScanOutcome::kUpdated);
  }
}

/// Scans that wait for odometry while the pose is set: those before it are of the past.
TEST(ScanOdometryState, ScansOfBeforeThePoseAreNotUsed) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.odometry(0);
  driven.run(0, 3000);
  for (const int ms : {3007, 3057}) driven.pipeline.addScan(drive.scan(ms), drive.laser.base_from_laser);
  for (const int ms : {3020, 3040, 3060}) driven.pipeline.addOdometry(drive.odometry(ms));
  driven.pipeline.setPose(kElsewhere, kCovariance, at(3040));
  driven.process();
  const std::size_t n = driven.reports.size();
  EXPECT_FALSE(driven.reports[n - 2].estimate);
  EXPECT_EQ(driven.reports[n - 1].outcome, ScanOutcome::kReference);
  EXPECT_EQ(driven.reports[n - 1].stamp, at(3057));
}

/// Scans relate poses to each other: they can tell nothing about the error of the pose that has been set. Were the
/// clone of before still correlated with it, or its displacement counted once more, the covariance fell below this.
TEST(ScanOdometryState, ScansDoNotMakeThePoseThatWasSetMoreCertain) {
  const SimulatedDrive drive;
  for (const std::string& method : fusionMethodNames()) {
    SCOPED_TRACE(method);
    Driven driven(drive, withMethod(method));
    driven.odometry(0);
    driven.run(0, 4000);
    const Eigen::Matrix3d P_0 = Eigen::Vector3d(0.5, 0.4, 0.3).cwiseAbs2().asDiagonal();
    driven.pipeline.setPose(kElsewhere, P_0, at(4000));
    const std::size_t first = driven.reports.size();
    driven.run(4000, 10000);
    for (std::size_t i = first; i < driven.reports.size(); ++i) {
      const Estimate& estimate = driven.reports[i].estimate.value();
      Eigen::Matrix3d F;
      compose(kElsewhere, between(kElsewhere, estimate.odom_from_base), &F);
      const Eigen::Matrix3d more = estimate.covariance - F * P_0 * F.transpose();
      EXPECT_GT(smallestEigenvalue(more), -1e-6) << "scan " << i - first;
    }
  }
}

/// Monte Carlo: wheels that err as their model says, a pose set in the middle of the way that errs as it says.
TEST(ScanOdometryState, TheCovarianceCanBeBelievedAfterSettingThePose) {
  constexpr int kRuns = 30;
  PipelineOptions options;
  options.odometry_noise = {0.05, 0.05, 0.05, 0.05};
  double nees_at_once = 0.0;
  double nees_later = 0.0;
  for (int run = 1; run <= kRuns; ++run) {
    Wheels wheels;
    wheels.scale = 1.0;
    wheels.yaw_per_meter = 0.0;
    wheels.noise = options.odometry_noise;
    wheels.seed = static_cast<std::uint64_t>(run);
    const SimulatedDrive drive(wheels, 6100);
    RandomInputs random(1000 + run);
    Driven driven(drive, options);
    driven.odometry(0);
    driven.run(0, 3060);
    const SE2 told = corrected(drive.truth(3033), random.drawnFrom(kCovariance));
    driven.pipeline.setPose(told, kCovariance, at(3033));
    const auto nees = [&] {
      const ScanReport& report = driven.reports.back();
      const Eigen::Vector3d e = error(drive.truth(milliseconds(report.stamp)), report.estimate->odom_from_base);
      return e.dot(report.estimate->covariance.llt().solve(e)) / kRuns;
    };
    driven.run(3060, 3200);
    nees_at_once += nees();
    driven.run(3200, 6000);
    nees_later += nees();
  }
  // The mean of 30 χ² with 3 degrees of freedom lies here but for once in a thousand times.
  EXPECT_GT(nees_at_once, 1.74);
  EXPECT_LT(nees_at_once, 4.64);
  EXPECT_GT(nees_later, 1.74);
  EXPECT_LT(nees_later, 4.64);
}

// ---- options --------------------------------------------------------------------------------------------------------

TEST(ScanOdometryState, TheSameOptionsChangeNothing) {
  const SimulatedDrive drive;
  Driven left_alone(drive);
  Driven reset(drive);
  for (Driven* driven : {&left_alone, &reset}) driven->odometry(0);
  for (int ms = 0; ms < 5000; ms += 250) {
    for (Driven* driven : {&left_alone, &reset}) driven->run(ms, ms + 250);
    reset.pipeline.setOptions(reset.pipeline.options());
  }
  ASSERT_EQ(reset.reports.size(), left_alone.reports.size());
  for (std::size_t i = 0; i < reset.reports.size(); ++i) {
    EXPECT_EQ(reset.reports[i].outcome, left_alone.reports[i].outcome);
    EXPECT_EQ(reset.reports[i].new_reference, left_alone.reports[i].new_reference);
    expectNear(*reset.reports[i].estimate, *left_alone.reports[i].estimate, 0.0);
  }
  expectNear(*reset.pipeline.latest(), *left_alone.pipeline.latest(), 0.0);
}

/// Each group of options, by what it does to the scan that comes next.
TEST(ScanOdometryState, OptionsHoldFromTheNextScanOn) {
  const SimulatedDrive drive;
  const auto next = [&drive](const std::function<void(PipelineOptions&)>& change) {
    Driven driven(drive);
    driven.odometry(0);
    driven.run(0, 3000);
    PipelineOptions options = driven.pipeline.options();
    change(options);
    driven.pipeline.setOptions(options);
    EXPECT_EQ(driven.pipeline.latest()->stamp, at(3000));
    driven.run(3000, 3100);
    return driven.reports.back();
  };
  EXPECT_EQ(next([](PipelineOptions&) {}).outcome, ScanOutcome::kUpdated);
  EXPECT_FALSE(next([](PipelineOptions&) {}).new_reference);
  EXPECT_EQ(next([](PipelineOptions& o) { o.scan.min_points = 1000; }).outcome, ScanOutcome::kUnusable);
  EXPECT_EQ(next([](PipelineOptions& o) { o.matcher.min_pairs = 1000; }).outcome, ScanOutcome::kNoMatch);
  EXPECT_TRUE(next([](PipelineOptions& o) { o.reference.kf_dist_linear = 0.0; }).new_reference);
  const auto tight = [](PipelineOptions& o) {
    o.gate.trust_scans_on_slip = false;
    o.gate.probability = 1e-9;
  };
  EXPECT_EQ(next(tight).outcome, ScanOutcome::kGated);
  EXPECT_FALSE(next([](PipelineOptions& o) { o.motion = {0.0, 0.0, 0.0, 0.0, 0.5, 0.7}; }).wheels_known);
  EXPECT_EQ(next([](PipelineOptions& o) { o.twist_window = 10.0; }).estimate->twist.covariance(0, 0),
            Twist::kUnknownVariance);
}

TEST(ScanOdometryState, AnotherMethodNeedsANewEstimate) {
  ScanOdometry pipeline({});
  PipelineOptions options = withMethod("dead_reckoning");
  options.scan.min_points = 7;
  try {
    pipeline.setOptions(options);
    FAIL() << "not refused";
  } catch (const std::invalid_argument& refusal) {
    EXPECT_THAT(refusal.what(), testing::HasSubstr("\"dead_reckoning\": expected \"sckf_multi\""));
  }
  EXPECT_NE(pipeline.options().scan.min_points, 7);
}

}  // namespace
}  // namespace sckf::test
