// What the pipeline makes of scans that cannot be matched, contradict the wheels, or do not see everything.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>

#include "pipeline/simulated_drive.h"

namespace sckf::test {
namespace {

/// Nothing is learned of the wheels, so that what they tell is what moves the estimate.
PipelineOptions wheelsAsTheyAre() {
  PipelineOptions options;
  options.calibration = noCalibration();
  return options;
}

/// Wheels that are better than the defaults think, so that small contradictions are seen.
PipelineOptions trustingTheWheels() {
  PipelineOptions options = wheelsAsTheyAre();
  options.odometry_noise = {0.03, 0.02, 0.05, 0.03};
  return options;
}

/// Ahead, then a turn of 65° to the left between two scans while it goes on, ahead again.
SE2 sharpTurn(double t) {
  const double turned = std::clamp((t - 2.0) / 0.4, 0.0, 1.0);
  const double way = 0.4 * std::min(t, 2.4);
  const double yaw = 65.0 / 180.0 * M_PI * turned;
  return compose(SE2(-1.0 + way, -0.5, yaw), SE2(0.4 * std::max(t - 2.4, 0.0), 0.0, 0.0));
}

/// A scan with every range the same: NaN, or infinite where the laser sees nothing.
LaserScan constantScan(const SimulatedDrive& drive, int ms, float range) {
  LaserScan scan = drive.scan(ms);
  for (float& r : scan.ranges) r = range;
  return scan;
}

/// A scan with this number where the walls are farther than 2.5 m.
LaserScan nearsightedScan(const SimulatedDrive& drive, int ms, float no_return) {
  LaserScan scan = drive.scan(ms);
  for (float& r : scan.ranges) r = r > 2.5F ? no_return : r;
  return scan;
}

/// A scan in another place: a hall, no wall of which is near one of the room.
LaserScan scanElsewhere(const SimulatedDrive& drive, int ms) {
  const World hall = closedPolygon({{-13.0, -11.0}, {15.0, -11.0}, {15.0, 12.0}, {-13.0, 12.0}});
  LaserScan scan = simulateScan(hall, SE2(), drive.laser);
  scan.stamp = at(ms);
  return scan;
}

/// Over (from, to] there are people all around at every scan.
void driveThroughACrowd(const SimulatedDrive& drive, Driven& driven, int from, int to) {
  for (int ms = from + 20; ms <= to; ms += 20) {
    if (ms % 100 == 20) driven.scan(scanOfACrowd(drive, ms - 13));
    driven.odometry(ms);
  }
}

/// A drive of 2 s by the wheels and good scans.
Driven begun(const SimulatedDrive& drive, const PipelineOptions& options = wheelsAsTheyAre()) {
  Driven driven(drive, options);
  driven.odometry(0);
  driven.run(0, 2000);
  EXPECT_EQ(driven.count(ScanOutcome::kUpdated), 19U);
  return driven;
}

/// From one report to the next the wheels alone have moved the estimate, and made it less certain.
void expectCarriedOnByTheWheels(const SimulatedDrive& drive, const ScanReport& before, const ScanReport& after) {
  ASSERT_TRUE(before.estimate && after.estimate);
  const SE2 wheels = between(drive.wheels(milliseconds(before.stamp)), drive.wheels(milliseconds(after.stamp)));
  const SE2 moved = compose(before.estimate->odom_from_base, wheels);
  const Eigen::Vector3d off = error(after.estimate->odom_from_base, moved);
  EXPECT_LT(off.cwiseAbs().maxCoeff(), 2e-4) << "off by " << off.transpose();
  EXPECT_GT(after.estimate->covariance.determinant(), before.estimate->covariance.determinant());
}

/// Two seconds of good scans: at most the first fails, for want of a reference, and the estimate keeps to the truth.
void expectRecovers(Driven& driven, int from, double tolerance) {
  const std::size_t reports = driven.reports.size();
  driven.run(from, from + 2000);
  ASSERT_EQ(driven.reports.size(), reports + 20);
  for (std::size_t i = reports + 1; i < driven.reports.size(); ++i) {
    EXPECT_EQ(driven.reports[i].outcome, ScanOutcome::kUpdated) << i - reports << ": " << driven.reports[i].reason;
  }
  const Eigen::Vector3d e = driven.latestError(from + 2000);
  EXPECT_LT(e.head<2>().norm(), tolerance) << e.transpose();
  EXPECT_LT(std::abs(e.z()), tolerance) << e.transpose();
}

// ---- scans that give no displacement --------------------------------------------------------------------------------

void expectUnusableForASecond(float range) {
  const SimulatedDrive drive;
  Driven driven = begun(drive);
  for (int ms = 2020; ms <= 3000; ms += 20) {
    if (ms % 100 == 20) driven.scan(constantScan(drive, ms - 13, range));
    driven.odometry(ms);
  }
  ASSERT_EQ(driven.count(ScanOutcome::kUnusable), 10U);
  for (std::size_t i = driven.reports.size() - 10; i < driven.reports.size(); ++i) {
    EXPECT_THAT(driven.reports[i].reason, testing::HasSubstr("0 of 361 ranges"));
    EXPECT_FALSE(driven.reports[i].innovation);
    EXPECT_FALSE(driven.reports[i].new_reference);
    expectCarriedOnByTheWheels(drive, driven.reports[i - 1], driven.reports[i]);
  }
  expectRecovers(driven, 3000, 0.04);
}

TEST(ScanOdometryFaults, ANumberBelowRangeMaxThatStandsForNothingIsAsGoodAsInfinity) {
  const SimulatedDrive drive;
  std::vector<Driven> driven;
  const std::vector<float> numbers{std::numeric_limits<float>::infinity(), 2.56F};
  for (const float no_return : numbers) {
    Driven& robot = driven.emplace_back(drive);
    for (int ms = 0; ms <= 8000; ms += 20) {
      if (ms % 100 == 20) robot.scan(nearsightedScan(drive, ms - 13, no_return));
      robot.odometry(ms);
    }
    ASSERT_EQ(robot.reports.size(), 80U) << no_return;
    EXPECT_GE(robot.count(ScanOutcome::kUpdated), 70U) << no_return;
    EXPECT_FLOAT_EQ(static_cast<float>(robot.reports.back().no_return.value()), no_return);
    EXPECT_LT(robot.latestError(8000).head<2>().norm(), 0.05) << no_return;
  }
  for (std::size_t i = 0; i < 80; ++i) {
    EXPECT_EQ(driven[0].reports[i].estimate->odom_from_base.vector(),
              driven[1].reports[i].estimate->odom_from_base.vector())
        << i;
  }
}

TEST(ScanOdometryFaults, ABlindLaserLeavesItToTheWheels) {
  expectUnusableForASecond(std::numeric_limits<float>::infinity());
}

/// Scans that no driver should send. The estimate is that of the wheels, and the next good scan is used as ever.
struct BadScan {
  const char* name;
  void (*spoil)(LaserScan& scan);
  const char* reason;
};
void PrintTo(const BadScan& bad, std::ostream* os) { *os << bad.name; }

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

void fill(LaserScan& scan, float range) { std::fill(scan.ranges.begin(), scan.ranges.end(), range); }

const BadScan kBadScans[]{
    {"NaN", [](LaserScan& s) { fill(s, kNaN); },
     "0 of 361 ranges are finite and within [0.05, 30) m: expected at least 20"},
    {"Infinite", [](LaserScan& s) { fill(s, kInfinity); }, "0 of 361 ranges"},
    {"NegativeInfinite", [](LaserScan& s) { fill(s, -kInfinity); }, "0 of 361 ranges"},
    {"AllMax", [](LaserScan& s) { fill(s, static_cast<float>(s.range_max)); }, "0 of 361 ranges"},
    {"AllZero", [](LaserScan& s) { fill(s, 0.0F); }, "0 of 361 ranges"},
    {"AllNegative", [](LaserScan& s) { fill(s, -1.0F); }, "0 of 361 ranges"},
    {"Huge", [](LaserScan& s) { fill(s, 3e38F); }, "0 of 361 ranges"},
    {"Empty", [](LaserScan& s) { s.ranges.clear(); }, "0 of 0 ranges"},
    {"OneBeam", [](LaserScan& s) { s.ranges.resize(1); }, "1 of 1 ranges are finite and within"},
    {"NoIncrement", [](LaserScan& s) { s.angle_increment = 0.0; }, "angle_increment 0 with 361 ranges"},
    {"IncrementNaN", [](LaserScan& s) { s.angle_increment = kNaN; }, "angle_increment nan"},
    {"IncrementInDegrees", [](LaserScan& s) { s.angle_increment = 1.0; }, "expected values in rad"},
    {"AngleInfinite", [](LaserScan& s) { s.angle_min = kInfinity; }, "angle_min is inf"},
    {"RangeLimitsTurnedRound", [](LaserScan& s) { std::swap(s.range_min, s.range_max); },
     "range_min is 30, range_max 0.05: expected range_min below range_max"},
    {"RangeLimitsNaN", [](LaserScan& s) { s.range_min = s.range_max = kNaN; }, "range_min is nan"},
    {"RangeLimitsZero", [](LaserScan& s) { s.range_min = s.range_max = 0.0; }, "range_max 0: expected"},
};

class ScanOdometryBadScan : public ::testing::TestWithParam<BadScan> {};

TEST_P(ScanOdometryBadScan, LeavesItToTheWheels) {
  const SimulatedDrive drive;
  Driven driven = begun(drive);
  LaserScan bad = drive.scan(2007);
  GetParam().spoil(bad);
  driven.scan(bad);
  driven.odometry(2020);
  const ScanReport& report = driven.reports.back();
  EXPECT_EQ(report.outcome, ScanOutcome::kUnusable);
  EXPECT_THAT(report.reason, testing::HasSubstr(GetParam().reason));
  EXPECT_FALSE(report.new_reference);
  expectCarriedOnByTheWheels(drive, driven.reports[driven.reports.size() - 2], report);
  for (int ms = 2040; ms <= 2100; ms += 20) driven.odometry(ms);
  expectRecovers(driven, 2100, 0.04);
}

INSTANTIATE_TEST_SUITE_P(Cases, ScanOdometryBadScan, ::testing::ValuesIn(kBadScans),
                         [](const auto& info) { return info.param.name; });

/// A laser that turns the other way round sees the same room.
TEST(ScanOdometryFaults, AnAngleRangeTurnedRoundIsAsGood) {
  SimulatedDrive drive;
  drive.laser.angle_min = M_PI;
  drive.laser.angle_increment = -2.0 * M_PI / 361.0;
  Driven driven(drive);
  driven.odometry(0);
  driven.run(0, 6000);
  EXPECT_EQ(driven.count(ScanOutcome::kUpdated), 59U);
  expectAccurate(drive, driven);
}

/// Half of the readings missing, in every way that drivers say so.
TEST(ScanOdometryFaults, ReadingsThatAreMissingAreLeftOut) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.odometry(0);
  for (int ms = 1; ms <= 6000; ++ms) {
    if (ms % 20 == 0) driven.odometry(ms);
    if (ms % 100 != 7) continue;
    LaserScan scan = drive.scan(ms);
    const float missing[]{kNaN, kInfinity, -kInfinity, 0.0F, 30.0F, 1e30F, -3.0F};
    for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
      if ((i / 20) % 2 == 0) scan.ranges[i] = missing[i % 7];
    }
    driven.scan(scan);
  }
  EXPECT_EQ(driven.count(ScanOutcome::kUpdated), 59U);
  expectAccurate(drive, driven);
}

TEST(ScanOdometryFaults, AHundredThousandBeamsTakeNoLongerThanTheMostAllowed) {
  SimulatedDrive drive;
  drive.laser.beams = 100000;
  drive.laser.angle_increment = 2.0 * M_PI / drive.laser.beams;
  Driven driven(drive);
  driven.odometry(0);
  driven.run(0, 600);
  EXPECT_EQ(driven.count(ScanOutcome::kUpdated), 5U);
  expectAccurate(drive, driven);
  for (const ScanReport& report : driven.reports) {
    EXPECT_EQ(report.scan->beams, 2041U);  // every 49th
    EXPECT_LT(report.match_time, report.total_time + 1e-9);
    EXPECT_LT(report.total_time, 2.0) << "bounded, however slow the machine";
  }
}

TEST(ScanOdometryFaults, AMountThatIsNoPoseMakesTheScanUnusable) {
  const SimulatedDrive drive;
  Driven driven = begun(drive);
  Eigen::Isometry3d mount = Eigen::Isometry3d::Identity();
  mount.translation().x() = std::numeric_limits<double>::quiet_NaN();
  driven.pipeline.addScan(drive.scan(2007), mount);
  driven.odometry(2020);
  EXPECT_EQ(driven.reports.back().outcome, ScanOutcome::kUnusable);
  EXPECT_THAT(driven.reports.back().reason, testing::HasSubstr("mount"));
  expectRecovers(driven, 2020, 0.04);
}

TEST(ScanOdometryFaults, AnUnusableFirstScanIsNoReference) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.odometry(0);
  driven.scan(constantScan(drive, 7, 0.0F));
  driven.odometry(20);
  EXPECT_EQ(driven.reports.back().outcome, ScanOutcome::kUnusable);
  EXPECT_FALSE(driven.reports.back().new_reference);
  driven.run(20, 200);
  EXPECT_EQ(driven.reports.back().outcome, ScanOutcome::kReference);
}

TEST(ScanOdometryFaults, AScanOfAnotherPlaceLeavesItToTheWheels) {
  const SimulatedDrive drive;
  Driven driven = begun(drive);
  for (const int ms : {2020, 2040, 2060, 2080, 2100}) {
    if (ms == 2020) driven.scan(scanElsewhere(drive, 2007));
    driven.odometry(ms);
  }
  const ScanReport& report = driven.reports.back();
  EXPECT_EQ(report.outcome, ScanOutcome::kNoMatch) << toString(report.outcome);
  EXPECT_EQ(report.reason, toString(report.match.failure));
  EXPECT_NE(report.match.failure, MatchFailure::kNone);
  EXPECT_FALSE(report.innovation);
  EXPECT_TRUE(report.new_reference) << "the robot may be there";
  expectCarriedOnByTheWheels(drive, driven.reports[driven.reports.size() - 2], report);
  expectRecovers(driven, 2100, 0.04);
}

double stdOfYaw(const ScanReport& report) { return std::sqrt(report.estimate.value().covariance(2, 2)); }

/// Nobody knows whether scan or wheels are wrong. But what comes after it is as far from what is known.
TEST(ScanOdometryFaults, AScanThatNothingPlacesLeavesThePoseUncertainOnce) {
  const SimulatedDrive drive;
  PipelineOptions options = trustingTheWheels();
  for (const bool trust_scans_on_slip : {true, false}) {
    options.gate.trust_scans_on_slip = trust_scans_on_slip;
    Driven driven = begun(drive, options);
    const double before = stdOfYaw(driven.reports.back());
    driveThroughACrowd(drive, driven, 2000, 2500);
    EXPECT_EQ(driven.count(ScanOutcome::kUpdated), 19U);
    const double slip = trust_scans_on_slip ? options.gate.slip_std_yaw : 0.0;
    for (std::size_t i = driven.reports.size() - 5; i < driven.reports.size(); ++i) {
      EXPECT_NEAR(stdOfYaw(driven.reports[i]), std::hypot(before, slip), 0.04) << i;  // the wheels carry on
    }
  }
}

/// In a crowd, scans may agree by chance where they lie best.
TEST(ScanOdometryFaults, WhatNothingPlacesIsNoReferenceForAPoorMatch) {
  SimulatedDrive drive;
  drive.laser = frontLaser();
  PipelineOptions options = wheelsAsTheyAre();
  const auto used = [&] {
    Driven driven = begun(drive, options);
    driveThroughACrowd(drive, driven, 2000, 12000);
    return driven.count(ScanOutcome::kUpdated) + driven.count(ScanOutcome::kSlip) - 19;
  };
  EXPECT_EQ(used(), 0U);
  options.gate.doubtful_min_agreement = 0.0;
  EXPECT_GT(used(), 0U);
}

/// More scans of a crowd than references are kept: those of the room are kept, and place the robot when it is seen
/// again.
TEST(ScanOdometryFaults, ACrowdDoesNotMakeTheRoomForgotten) {
  const SimulatedDrive drive;
  Driven driven = begun(drive);
  const double before = stdOfYaw(driven.reports.back());
  driveThroughACrowd(drive, driven, 2000, 4000);
  EXPECT_EQ(driven.count(ScanOutcome::kUpdated), 19U);
  expectRecovers(driven, 4000, 0.04);
  EXPECT_LT(stdOfYaw(driven.reports.back()), 2.0 * before);
}

/// The wheels freeze in a turn in which a crowd is all that is seen.
TEST(ScanOdometryFaults, AfterACrowdTheRobotIsFoundWhereverItHasTurned) {
  Wheels wheels;
  wheels.stand_still_from = 1950;
  wheels.stand_still_to = 2450;
  const SimulatedDrive drive(wheels, 6000, room(), sharpTurn);
  const auto lastError = [&drive](const PipelineOptions& options) {
    Driven driven(drive, options);
    driven.odometry(0);
    driven.run(0, 1900);
    driveThroughACrowd(drive, driven, 1900, 2500);
    driven.run(2500, 5980);
    return driven.latestError(5980);
  };
  PipelineOptions options;
  EXPECT_LT(lastError(options).head<2>().norm(), 0.06) << lastError(options).transpose();
  EXPECT_LT(std::abs(lastError(options).z()), 0.03) << lastError(options).transpose();
  options.gate.doubtful_min_agreement = 1.1;
  EXPECT_GT(std::abs(lastError(options).z()), 0.3) << "no scan is trusted that far: " << lastError(options).transpose();
}

/// Two scans of another place, where the second falls on the first: the way back goes by one more failure.
TEST(ScanOdometryFaults, FindsBackFromAReferenceInAnotherPlace) {
  const SimulatedDrive drive;
  Driven driven = begun(drive);
  for (int ms = 2020; ms <= 2200; ms += 20) {
    if (ms % 100 == 20) driven.scan(scanElsewhere(drive, ms - 13));
    driven.odometry(ms);
  }
  EXPECT_EQ(driven.count(ScanOutcome::kNoMatch), 1U);
  expectRecovers(driven, 2200, 0.06);
}

/// Snow, seen by three of ten beams, is none of the room, nor where it was at the next scan.
LaserScan inSnow(LaserScan scan, int ms) {
  std::mt19937_64 random(static_cast<std::uint64_t>(ms));
  std::uniform_real_distribution<double> share(0.0, 1.0);
  for (float& range : scan.ranges) {
    if (share(random) < 0.3) range = static_cast<float>(0.3 + (range - 0.3) * share(random));
  }
  return scan;
}

/// Where scans never agree as well as in a building, one that fits nowhere must not make all that follow doubtful.
TEST(ScanOdometryFaults, WhereScansNeverAgreeWellOneThatFitsNowhereIsForgiven) {
  const World other = closedPolygon({{-6, -4}, {2, -4}, {2, -3}, {4, -3}, {4, 4.5}, {0, 4.5}, {0, 6}, {-6, 6}});
  const SimulatedDrive drive({}, 46000);
  const SimulatedDrive elsewhere({}, 46000, other);
  Driven driven(drive, wheelsAsTheyAre());
  driven.odometry(0);
  for (int ms = 20; ms <= 46000; ms += 20) {
    if (ms % 100 == 20) driven.scan(inSnow((ms < 5000 ? drive : elsewhere).scan(ms - 13), ms));  // by a lift
    driven.odometry(ms);
  }
  std::size_t before = 0;
  std::size_t at_last = 0;
  for (const ScanReport& report : driven.reports) {
    if (!wasUsed(report.outcome)) continue;
    if (report.stamp < at(5000)) ++before;
    if (report.stamp > at(36000)) ++at_last;
  }
  EXPECT_GT(before, 40U) << "of 49: the snow alone is no obstacle";
  EXPECT_GT(at_last, 80U) << "of 100";
  EXPECT_LT(driven.count(ScanOutcome::kUpdated), driven.reports.size() - 100) << "for some time they were in doubt";
}

/// Of the first board nothing is in view after the turn, and the second one is as wide and as far: the one falls on the
/// other as well as a wall on itself, and nothing that is seen tells against the wheels.
TEST(ScanOdometryFaults, WhatFallsOnAnotherWallPerfectlyIsNoSlipIfNothingTellsAgainstTheWheels) {
  const auto turned = [](double yaw, double y) {
    return Eigen::Vector2d(SE2(0.0, 0.0, yaw).rotation() * Eigen::Vector2d(2.0, y));
  };
  World boards;
  for (const double yaw : {0.0, 1.2}) boards.push_back({turned(yaw, -0.5), turned(yaw, 0.5)});
  const auto turning = [](double t) { return SE2(0.0, 0.0, 1.2 * std::clamp((t - 1.0) / 0.08, 0.0, 1.0)); };
  Wheels right;
  right.scale = 1.0;
  right.yaw_per_meter = 0.0;
  SimulatedDrive drive(right, 3000, boards, turning);
  drive.laser.beams = 121;
  drive.laser.angle_min = -0.5;
  drive.laser.angle_increment = 1.0 / 120.0;
  PipelineOptions options = trustingTheWheels();
  options.motion.max_yaw_rate = 20.0;
  Driven driven(drive, options);
  driven.odometry(0);
  driven.run(0, 2980);
  EXPECT_EQ(driven.count(ScanOutcome::kSlip), 0U);
  EXPECT_LT(driven.latestError(2980).head<2>().norm(), 0.1) << driven.latestError(2980).transpose();
  EXPECT_LT(std::abs(driven.latestError(2980).z()), 0.1) << driven.latestError(2980).transpose();
}

// ---- contradictions -------------------------------------------------------------------------------------------------

/// The laser is 0.08 m to the left of where it is taken to be: a displacement that the wheels have not seen.
TEST(ScanOdometryFaults, ADisplacementBeyondTheGateIsRefused) {
  const SimulatedDrive drive;
  PipelineOptions options = trustingTheWheels();
  options.gate.trust_scans_on_slip = false;
  Driven driven = begun(drive, options);
  driven.scan(drive.scanDisplaced(2007, SE2(0, 0.08, 0)));
  driven.odometry(2020);
  const ScanReport& report = driven.reports.back();
  ASSERT_EQ(report.outcome, ScanOutcome::kGated) << toString(report.outcome) << " " << report.reason;
  ASSERT_TRUE(report.match.displacement && report.innovation);
  const SE2& displacement = report.match.displacement->reference_from_current;
  const Eigen::Vector3d off = error(displacement, report.prediction.reference_from_current);
  EXPECT_NEAR(off.head<2>().norm(), 0.08, 0.02) << off.transpose();
  EXPECT_NEAR(off.z(), 0.0, 0.02) << off.transpose();
  EXPECT_GT(report.innovation->nis(), 16.266);  // of χ² with 3 degrees of freedom, 0.1 % lie beyond
  EXPECT_THAT(report.reason, testing::HasSubstr("normalised innovation squared"));
  EXPECT_THAT(report.reason, testing::HasSubstr(testing::PrintToString(16.2662)));
  expectCarriedOnByTheWheels(drive, driven.reports[driven.reports.size() - 2], report);
  for (int ms = 2040; ms <= 2100; ms += 20) driven.odometry(ms);
  expectRecovers(driven, 2100, 0.04);
}

TEST(ScanOdometryFaults, AWiderGateLetsTheSameDisplacementIn) {
  const SimulatedDrive drive;
  PipelineOptions options = trustingTheWheels();
  options.gate.trust_scans_on_slip = false;
  options.gate.probability = 1.0 - 1e-15;
  Driven driven = begun(drive, options);
  driven.scan(drive.scanDisplaced(2007, SE2(0, 0.06, 0)));
  driven.odometry(2020);
  EXPECT_EQ(driven.reports.back().outcome, ScanOutcome::kUpdated) << driven.reports.back().reason;
}

/// The wheels report no motion for 0.6 s, of 0.2 m or more: they spin, or their encoder is stuck.
constexpr int kSlipFrom = 2000;
constexpr int kSlipTo = 2600;

SimulatedDrive slippingDrive() {
  Wheels wheels;
  wheels.stand_still_from = kSlipFrom;
  wheels.stand_still_to = kSlipTo;
  return SimulatedDrive(wheels);
}

TEST(ScanOdometryFaults, WheelsThatFreezeInASharpTurnAreFoundOut) {
  Wheels wheels;
  wheels.stand_still_from = 1900;
  wheels.stand_still_to = 2900;
  SimulatedDrive drive(wheels, 6000, room(), sharpTurn);
  drive.laser = frontLaser();
  const auto lastError = [&drive](const PipelineOptions& options) {
    Driven driven(drive, options);
    driven.odometry(0);
    driven.run(0, 5980, 400);
    return driven.latestError(5980);
  };
  PipelineOptions options;
  EXPECT_LT(lastError(options).head<2>().norm(), 0.06) << lastError(options).transpose();
  EXPECT_LT(std::abs(lastError(options).z()), 0.03);
  options.matcher.wide_search.yaw = 0.0;
  EXPECT_GT(std::abs(lastError(options).z()), 0.3) << "the turn is no test";
}

/// The error after a rotation that only the wheels tell of, on a way straight ahead that is 0.2 m from scan to scan.
Eigen::Vector3d errorAfterYawSlip(const World& world, double slip, const PipelineOptions& options = {}) {
  Wheels wheels;
  wheels.yaw_slip_at = 2050;
  wheels.yaw_slip = slip;
  const SimulatedDrive drive(wheels, 3000, world, [](double t) { return SE2(-2.0 + 0.5 * t, 0.2, 0.1); });
  Driven driven(drive, options);
  driven.odometry(0);
  driven.run(0, 2980, 400);
  return driven.latestError(2980);
}

TEST(ScanOdometryFaults, AYawThatOnlyTheWheelsTellMovesNothing) {
  for (const double slip : {0.5, -1.2}) {
    const Eigen::Vector3d e = errorAfterYawSlip(room(), slip);
    EXPECT_LT(e.head<2>().norm(), 0.04) << slip << ": " << e.transpose();
    EXPECT_LT(std::abs(e.z()), 0.02) << slip << ": " << e.transpose();
  }
}

TEST(ScanOdometryFaults, InACorridorTooWhichDoesNotTellTheWayAlongIt) {
  const Eigen::Vector3d e = errorAfterYawSlip(corridor(), 0.6);
  EXPECT_LT(std::abs(e.y()), 0.04) << e.transpose();
  EXPECT_LT(std::abs(e.z()), 0.02) << e.transpose();
  EXPECT_LT(std::abs(e.x()), 0.3) << "the wheels tell as much: " << e.transpose();
  PipelineOptions options;
  options.gate.slip_min_overlap = 1.1;  // of two directions
  EXPECT_GT(std::abs(errorAfterYawSlip(corridor(), 0.6, options).z()), 0.3) << "such scans were not to be trusted";
  EXPECT_LT(std::abs(errorAfterYawSlip(room(), 0.6, options).z()), 0.02) << "but where they see all, they are";
}

TEST(ScanOdometryFaults, WheelsThatCanSlipInYawAloneLeaveTheEstimateSound) {
  Wheels wheels;
  wheels.stand_still_to = 3000;  // nothing is told, and nothing is uncertain: the covariance of the place is zero
  const SimulatedDrive drive(wheels, 3000, room(), [](double t) { return SE2(0.2, 0.1, 0.8 * t); });
  PipelineOptions options;
  options.gate.slip_std_translation = 0.0;
  Driven driven(drive, options);
  driven.odometry(0);
  driven.run(0, 2980, 400);
  EXPECT_GE(driven.count(ScanOutcome::kSlip), 1U);
  EXPECT_LT(std::abs(error(driven.reports.back().estimate.value().odom_from_base, drive.truth(2807)).z()), 0.02);
}

/// By 2.4 m from scan to scan.
TEST(ScanOdometryFaults, WheelsThatLoseTheSignWhereTheRobotReversesDoNotLeadItAstray) {
  Wheels wheels;
  wheels.scale = 1.0;
  wheels.yaw_per_meter = 0.0;
  wheels.spin = -1.0;
  wheels.spin_from = 2000;
  wheels.spin_to = 6000;
  const SimulatedDrive drive(wheels, 6000, room(),
                             [](double t) { return SE2(t < 2.0 ? 0.6 * t - 0.2 : 1.0 - 0.6 * (t - 2.0), 0.1, 0.2); });
  const auto lastError = [&drive](const PipelineOptions& options) {
    Driven driven(drive, options);
    driven.odometry(0);
    driven.scan(0);
    driven.run(0, 5980, 2000);
    return error(driven.reports.back().estimate.value().odom_from_base, drive.truth(4007));
  };
  PipelineOptions options;
  EXPECT_LT(lastError(options).head<2>().norm(), 0.04) << lastError(options).transpose();
  options.matcher.wide_search.yaw = 0.0;
  EXPECT_GT(lastError(options).head<2>().norm(), 1.0) << "it is no test";
}

TEST(ScanOdometryFaults, WhereTheWheelsSlipTheScansAreFollowed) {
  const SimulatedDrive drive = slippingDrive();
  Driven driven = begun(drive);
  driven.run(kSlipFrom, 4000);
  EXPECT_GE(driven.count(ScanOutcome::kSlip), 4U);
  EXPECT_EQ(driven.count(ScanOutcome::kGated), 0U);
  for (const ScanReport& report : driven.reports) {
    const Eigen::Vector3d e = error(report.estimate.value().odom_from_base, drive.truth(milliseconds(report.stamp)));
    EXPECT_LT(e.head<2>().norm(), 0.04) << "at " << milliseconds(report.stamp) << " ms: " << e.transpose();
    const bool slips = milliseconds(report.stamp) > kSlipFrom && milliseconds(report.stamp) < kSlipTo + 100;
    if (!slips) {
      EXPECT_NE(report.outcome, ScanOutcome::kSlip) << "at " << milliseconds(report.stamp) << " ms";
    }
  }
  const double missed = between(drive.truth(kSlipFrom), drive.truth(kSlipTo)).translation().norm();
  EXPECT_GT(missed, 0.2) << "the slip is no test";
}

TEST(ScanOdometryFaults, ScansThatAreNotTrustedOnSlipAreGated) {
  const SimulatedDrive drive = slippingDrive();
  PipelineOptions options;
  options.gate.trust_scans_on_slip = false;
  Driven driven = begun(drive, options);
  driven.run(kSlipFrom, kSlipTo);
  EXPECT_EQ(driven.count(ScanOutcome::kSlip), 0U);
  EXPECT_GE(driven.count(ScanOutcome::kGated), 1U);
  for (const ScanReport& report : driven.reports) {
    if (report.outcome == ScanOutcome::kGated) {
      EXPECT_THAT(report.reason, testing::HasSubstr("exceeds"));
    }
  }
}

/// A slip is believed only of scans that match well.
TEST(ScanOdometryFaults, APoorMatchIsNoSlip) {
  const SimulatedDrive drive = slippingDrive();
  PipelineOptions options;
  options.gate.slip_max_misfit = 0.01;
  Driven driven = begun(drive, options);
  driven.run(kSlipFrom, kSlipTo);
  EXPECT_EQ(driven.count(ScanOutcome::kSlip), 0U);
  EXPECT_GE(driven.count(ScanOutcome::kGated), 1U);
}

// ---- a carpet -------------------------------------------------------------------------------------------------------

/// On a carpet the wheels spin for two seconds, and report twice the way. Off it they err as their model says.
constexpr int kCarpetFrom = 4000;
constexpr int kCarpetTo = 6000;

SimulatedDrive overACarpet(std::uint64_t seed) {
  Wheels wheels;
  wheels.scale = 1.0;
  wheels.yaw_per_meter = 0.0;
  wheels.noise = trustingTheWheels().odometry_noise;
  wheels.seed = seed;
  wheels.spin = 2.5;
  wheels.spin_from = kCarpetFrom;
  wheels.spin_to = kCarpetTo;
  return SimulatedDrive(wheels, 8100);
}

TEST(ScanOdometryFaults, OnACarpetTheSlipIsSeenAndCounted) {
  const SimulatedDrive drive = overACarpet(1);
  Driven driven(drive, trustingTheWheels());
  driven.odometry(0);
  driven.run(0, 8000);
  int slips_on_the_carpet = 0;
  for (const ScanReport& report : driven.reports) {
    const int ms = milliseconds(report.stamp);
    const bool on_carpet = ms > kCarpetFrom && ms < kCarpetTo + 100;
    if (report.outcome == ScanOutcome::kSlip) {
      EXPECT_TRUE(on_carpet) << "at " << ms << " ms";
      ++slips_on_the_carpet;
    } else if (report.new_reference || report.outcome != ScanOutcome::kReference) {
      EXPECT_TRUE(report.outcome == ScanOutcome::kUpdated || ms == 7) << "at " << ms << " ms: " << report.reason;
    }
    const Eigen::Vector3d e = error(report.estimate.value().odom_from_base, drive.truth(ms));
    EXPECT_LT(e.head<2>().norm(), 0.04) << "at " << ms << " ms: " << e.transpose();
  }
  EXPECT_GE(slips_on_the_carpet, 15);
  EXPECT_EQ(driven.count(ScanOutcome::kSlip), static_cast<std::size_t>(slips_on_the_carpet));

  // Without: the wheels are believed, and more than half a metre is lost, but for older references to find it again.
  PipelineOptions believing = trustingTheWheels();
  believing.method = "sckf";
  believing.gate.trust_scans_on_slip = false;
  Driven misled(drive, believing);
  misled.odometry(0);
  misled.run(0, 8000);
  EXPECT_GT(misled.latestError(8000).head<2>().norm(), 0.5) << "the carpet is no test";
}

/// Monte Carlo over carpets: the covariance can be believed on it and after it.
TEST(ScanOdometryFaults, OnACarpetTheCovarianceCanBeBelieved) {
  constexpr int kRuns = 20;
  PipelineOptions options = trustingTheWheels();
  options.matcher.estimation.place_std = 0.0;  // in this room everything is where it seems to be
  double on_carpet = 0.0;
  double after = 0.0;
  for (int run = 1; run <= kRuns; ++run) {
    const SimulatedDrive drive = overACarpet(static_cast<std::uint64_t>(run));
    Driven driven(drive, options);
    driven.odometry(0);
    driven.run(0, 8000);
    for (const ScanReport& report : driven.reports) {
      const int ms = milliseconds(report.stamp);
      const Eigen::Vector3d e = error(report.estimate->odom_from_base, drive.truth(ms));
      // From the first scan on: where the estimate starts is known exactly.
      const double nees = e.dot(report.estimate->covariance.ldlt().solve(e)) / kRuns;
      if (ms == 5807) on_carpet += nees;
      if (ms == 7907) after += nees;
    }
  }
  // The mean of 20 χ² with 3 degrees of freedom lies in [1.49, 5.08] but for once in a thousand times.
  EXPECT_GT(on_carpet, 1.0);
  EXPECT_LT(on_carpet, 6.0);
  EXPECT_GT(after, 1.0);
  EXPECT_LT(after, 6.0);
}

// ---- what scans do not see ------------------------------------------------------------------------------------------

/// Along a corridor the wheels tell the way, and the scans heading and distance to the walls.
TEST(ScanOdometryFaults, AlongACorridorTheWheelsTellTheWay) {
  const auto ahead = [](double t) { return SE2(0.5 * t, 0.2, 0.0); };
  const SimulatedDrive drive(Wheels(), 10000, corridor(), ahead);
  Driven driven(drive);
  driven.odometry(0);
  driven.run(0, 10000);
  EXPECT_EQ(driven.count(ScanOutcome::kUpdated), 99U);
  int along_too = 0;  // noise may feign the third direction, but seldom
  for (const ScanReport& report : driven.reports) {
    if (report.outcome == ScanOutcome::kReference) continue;
    ASSERT_TRUE(report.match.displacement) << report.reason;
    along_too += report.match.displacement->dimension() == 2 ? 0 : 1;
    EXPECT_EQ(report.innovation.value().residual.size(), report.match.displacement->dimension());
  }
  EXPECT_LE(along_too, 1);
  const Estimate last = driven.pipeline.latest().value();
  EXPECT_NEAR(last.odom_from_base.x, 1.03 * 5.0, 0.02) << "the wheels' own scale, no less";
  EXPECT_NEAR(last.odom_from_base.y, 0.0, 0.05);
  EXPECT_NEAR(last.odom_from_base.yaw, 0.0, 0.02);
  EXPECT_GT(std::abs(drive.wheels(10000).y), 0.3) << "the wheels are no test";
  // Along: 0.05 m/√m over 5 m, and 0.02 of them. Across, the scans.
  EXPECT_NEAR(std::sqrt(last.covariance(0, 0)), std::hypot(0.05 * std::sqrt(5.15), 0.02 * 5.15), 0.01);
  EXPECT_LT(last.covariance(1, 1), 0.1 * last.covariance(0, 0));
}

/// Somebody walks before the robot along a corridor that shows nothing else of the way: to the scans the robot would
/// stand.
TEST(ScanOdometryFaults, AlongACorridorWhoWalksAheadDoesNotHoldTheRobot) {
  const auto ahead = [](double t) { return SE2(0.4 * t, 0.2, 0.0); };
  const auto errorAlong = [&ahead](double min_share) {
    Wheels wheels;
    wheels.scale = 1.0;
    wheels.yaw_per_meter = 0.0;
    const SimulatedDrive drive(wheels, 20000, corridor(), ahead);
    PipelineOptions options;
    options.matcher.moved_place_min_share = min_share;
    Driven driven(drive, options);
    driven.odometry(0);
    std::mt19937_64 random(2);
    SimulatedLaser laser = drive.laser;
    laser.range_max = 12.0;
    for (int ms = 20; ms <= 20000; ms += 20) {
      driven.odometry(ms);
      if (ms % 400 != 0) continue;
      const SE2 robot = ahead(1e-3 * ms);
      const World world = withSomebodyAt(corridor(), {robot.x + 2.5, 0.5});
      LaserScan scan = simulateScan(world, robot, laser, &random);
      scan.stamp = at(ms);
      driven.scan(scan);
    }
    return driven.latestError(20000).x();
  };
  EXPECT_LT(std::abs(errorAlong(0.5)), 0.2) << "of 8 m";
  EXPECT_LT(errorAlong(0.0), -0.6) << "nothing holds the robot: no test";
}

}  // namespace
}  // namespace sckf::test
