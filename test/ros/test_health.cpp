#include <gtest/gtest.h>

#include "sckf_odometry/ros/health.h"
#include "text_matchers.h"

namespace sckf {
namespace {

using Level = diagnostic_msgs::DiagnosticStatus;

ros::Time at(double time) { return ros::Time(time); }

ScanReport scan(ScanOutcome outcome, double time, const std::string& reason = "") {
  ScanReport report;
  report.outcome = outcome;
  report.stamp = Stamp(static_cast<Stamp::rep>(at(time).toNSec()));
  report.reason = reason;
  report.estimate = Estimate();
  report.total_time = 0.002;
  return report;
}

class HealthTest : public testing::Test {
 protected:
  HealthTest() {
    health_.odometry.came(at(100.0), at(100.0));
    health_.scanCame(0, at(100.0), at(100.0));
  }

  struct Verdict {
    int level;
    std::string text;
  };

  Verdict verdictAt(double time) {
    status_.values.clear();
    health_.report(conditions_, options_, at(time), status_);
    return {status_.level, status_.message};
  }

  std::string value(const std::string& key) const {
    for (const auto& entry : status_.values) {
      if (entry.key == key) return entry.value;
    }
    return "missing";
  }

  Health health_{"/odom", {"/scan"}};
  Health::Conditions conditions_;
  Options options_;
  diagnostic_updater::DiagnosticStatusWrapper status_;
};

TEST_F(HealthTest, AllIsWellWhileMessagesCome) { EXPECT_EQ(verdictAt(100.9).level, Level::OK); }

TEST_F(HealthTest, ALaserThatIsSilentIsNamedAndTheOthersAreSaidToCarryOn) {
  health_ = Health("/odom", {"/front", "/rear"});
  EXPECT_EQ(health_.topicNotHeard(), "/front");
  health_.scanCame(0, at(100.0), at(100.0));
  EXPECT_EQ(health_.topicNotHeard(), "/front");
  health_.scanAdmitted(0);
  EXPECT_EQ(health_.topicNotHeard(), "/rear");
  health_.scanCame(1, at(100.0), at(100.0));
  health_.scanAdmitted(1);
  EXPECT_EQ(health_.topicNotHeard(), "");
  health_.scanCame(0, at(103.0), at(103.0));
  Verdict verdict = verdictAt(103.0);
  EXPECT_EQ(verdict.level, Level::WARN);
  EXPECT_EQ(verdict.text, "no scans on /rear for 3 s (~scan_timeout: 2 s): wheels and other lasers carry on");
  verdict = verdictAt(106.0);
  EXPECT_TRUE(contains(verdict.text, "no scans on /front for 3 s (~scan_timeout: 2 s): the wheels carry on alone"));
  EXPECT_TRUE(contains(verdict.text, "no scans on /rear for 6 s"));
}

TEST_F(HealthTest, WheelsThatAreSilentAreAnErrorThatSaysWhatHappens) {
  Verdict verdict = verdictAt(101.5);
  EXPECT_EQ(verdict.level, Level::ERROR);
  EXPECT_EQ(verdict.text, "no odometry on /odom for 1.5 s (~odometry_timeout: 1 s): the estimate waits");
  options_.pipeline.scans_alone = true;
  EXPECT_TRUE(contains(verdictAt(101.5).text, "the scans carry on alone"));
  health_.odometry.came(at(101.6), at(101.6));
  EXPECT_EQ(verdictAt(101.7).level, Level::OK);
}

TEST_F(HealthTest, SilentScansAreAWarning) {
  health_.odometry.came(at(103.0), at(103.0));
  const Verdict verdict = verdictAt(103.0);
  EXPECT_EQ(verdict.level, Level::WARN);
  EXPECT_EQ(verdict.text, "no scans on /scan for 3 s (~scan_timeout: 2 s): the wheels carry on alone");
}

TEST_F(HealthTest, AllThatIsWrongIsSaidUnderTheWorstLevel) {
  conditions_.waiting_for = "the mount";
  const Verdict verdict = verdictAt(101.5);
  EXPECT_EQ(verdict.level, Level::ERROR);
  EXPECT_TRUE(contains(verdict.text, "the estimate waits; waiting for the mount"));
}

TEST_F(HealthTest, MessagesBeforeThereIsATimeAreNoSilence) {
  Health health("/odom", {"/scan"});
  health.odometry.came(at(1000.0), ros::Time());
  health.scanCame(0, at(1000.0), ros::Time());
  health.report(conditions_, options_, at(1000.0), status_);
  EXPECT_EQ(status_.message, "estimating");
}

TEST_F(HealthTest, TimeThatGoesBackIsNoSilence) { EXPECT_EQ(verdictAt(10.0).level, Level::OK); }

TEST_F(HealthTest, WaitingAndPauseAreWarnings) {
  conditions_.waiting_for = "the mount";
  EXPECT_EQ(verdictAt(100.1).text, "waiting for the mount");
  conditions_.paused = true;
  EXPECT_EQ(verdictAt(100.1).text, "paused");
  EXPECT_EQ(verdictAt(100.1).level, Level::WARN);
}

TEST_F(HealthTest, ASlipIsAWarningUntilTheNextReportAndIsCounted) {
  health_.scanTaken(scan(ScanOutcome::kSlip, 100.1));
  EXPECT_EQ(verdictAt(100.1).text, "the wheels slip: the scans are believed");
  EXPECT_EQ(value("wheels slip"), "True");
  health_.scanTaken(scan(ScanOutcome::kUpdated, 100.2));
  EXPECT_EQ(verdictAt(100.2).level, Level::OK);
  EXPECT_EQ(value("wheels slip"), "False");
  EXPECT_EQ(value("wheel slips"), "1");
}

TEST_F(HealthTest, AJumpOfTheOdometryIsAWarningUntilTheNextReport) {
  conditions_.odometry_jumps = 1;
  EXPECT_TRUE(contains(verdictAt(100.1).text, "odometry on /odom jumped"));
  EXPECT_EQ(verdictAt(100.2).level, Level::OK);
  health_.pipelineDropped("dropped, reset", 1);
  conditions_.odometry_jumps = 0;
  EXPECT_EQ(verdictAt(100.3).level, Level::OK);
  EXPECT_EQ(value("odometry: jumps"), "1");
  conditions_.odometry_jumps = 1;
  EXPECT_EQ(verdictAt(100.4).level, Level::WARN);
  EXPECT_EQ(value("odometry: jumps"), "2");
}

TEST_F(HealthTest, ManyScansInARowThatDidNotHelpAreAWarning) {
  for (int i = 0; i < 9; ++i) health_.scanTaken(scan(ScanOutcome::kUnusable, 100.1, "no points"));
  EXPECT_EQ(verdictAt(100.1).level, Level::OK);
  health_.scanTaken(scan(ScanOutcome::kUnusable, 100.1, "no points"));
  EXPECT_EQ(verdictAt(100.1).text, "the last 10 scans did not correct the estimate; the last one: unusable: no points");
  health_.scanTaken(scan(ScanOutcome::kUpdated, 100.1));
  EXPECT_EQ(verdictAt(100.1).level, Level::OK);
}

TEST_F(HealthTest, MessagesOfWhichNoneIsUsedAreAWarningWithTheReason) {
  options_.pipeline.imu.gyro = options_.pipeline.pose_updates.on = true;
  health_ = Health("/odom", {"/front", "/rear"});
  const auto refuse = [this](int count) {
    for (int i = 0; i < count; ++i) {
      health_.odometry.refused("no stamp", "header.stamp is 0");
      health_.scanRefused(1, "no frame", "header.frame_id is empty");
      health_.scanAdmitted(0);
      health_.imu.refused("no reading", "angular_velocity (0, 0, nan)");
      health_.pose_updates.refused("no pose", "position (nan, 0)");
    }
  };
  refuse(9);
  EXPECT_EQ(verdictAt(100.1).level, Level::OK);
  refuse(1);
  const Verdict verdict = verdictAt(100.1);
  EXPECT_EQ(verdict.level, Level::WARN);
  EXPECT_EQ(verdict.text,
            "none of the last 10 messages of odometry on /odom was used; the last one: header.stamp is 0; "
            "none of the last 10 messages of scans on /rear was used; the last one: header.frame_id is empty; "
            "none of the last 10 messages of the IMU was used; the last one: angular_velocity (0, 0, nan); "
            "none of the last 10 messages of absolute poses was used; the last one: position (nan, 0)");
  EXPECT_EQ(value("odometry: refused, no stamp"), "10");
  health_.odometry.used();
  health_.scanAdmitted(1);
  health_.imu.used();
  PoseReport pose;
  pose.outcome = PoseOutcome::kUsed;
  health_.poseUpdateTaken(pose);
  EXPECT_EQ(verdictAt(100.2).level, Level::OK);
}

TEST_F(HealthTest, WithoutATimeItWarns) {
  const Verdict verdict = verdictAt(0.0);
  EXPECT_EQ(verdict.level, Level::WARN);
  EXPECT_EQ(verdict.text, "no time on /clock, and /use_sim_time is true");
}

TEST_F(HealthTest, ASecondParentOfTheFrameIsAWarning) {
  conditions_.second_parent = "/driver publishes odom -> base_link on TF too";
  EXPECT_EQ(verdictAt(100.1).level, Level::WARN);
  EXPECT_EQ(verdictAt(100.1).text, conditions_.second_parent);
}

TEST_F(HealthTest, EveryScanIsAccountedFor) {
  for (int i = 0; i < 6; ++i) health_.scanCame(0, at(100.0), at(100.0));  // with the first: 7
  health_.scanRefused(0, "no stamp", "header.stamp is 0");
  for (int i = 0; i < 4; ++i) health_.scanPassed();
  health_.scanTaken(scan(ScanOutcome::kReference, 100.1));
  health_.scanTaken(scan(ScanOutcome::kOutOfOrder, 100.1, "not newer"));
  conditions_.scans_held_back = 1;
  conditions_.scans_without_mount = 1;
  verdictAt(100.1);
  EXPECT_EQ(value("scans: received"), "7");
  EXPECT_EQ(value("scans: together"), "3");
  EXPECT_EQ(value("scans: refused"), "1");
  EXPECT_EQ(value("scans: waiting for odometry"), "2");
  EXPECT_EQ(value("scans: waiting for their mount"), "1");
  EXPECT_EQ(value("scans: held back"), "1");
  health_.pipelineDropped("dropped, reset", 0);
  verdictAt(100.1);
  EXPECT_EQ(value("scans: dropped, reset"), "2");
  EXPECT_EQ(value("scans: together"), "5");
}

TEST_F(HealthTest, WhyScansDidNotMatchIsCounted) {
  ScanReport report = scan(ScanOutcome::kNoMatch, 100.1, "no overlap");
  report.match.failure = MatchFailure::kNoOverlap;
  health_.scanTaken(report);
  verdictAt(100.1);
  EXPECT_EQ(value("scans: no match, no overlap"), "1");
}

TEST_F(HealthTest, RatesAndLatenciesAreThoseSinceTheLastReport) {
  verdictAt(100.0);
  for (int i = 1; i <= 20; ++i) health_.odometry.came(at(100.0 + 0.05 * i), at(100.0 + 0.05 * i + 0.01 * (i % 2)));
  verdictAt(101.0);
  EXPECT_EQ(value("odometry: rate [1/s]"), "20.0");
  EXPECT_EQ(value("odometry: latency, mean [s]"), "0.005");
  EXPECT_EQ(value("odometry: latency, longest [s]"), "0.010");
  verdictAt(101.0);
  EXPECT_EQ(value("odometry: rate [1/s]"), "0.0");
  EXPECT_EQ(value("odometry: latency, mean [s]"), "missing");
}

TEST_F(HealthTest, AMessageWithoutStampHasNoLatency) {
  verdictAt(100.0);
  health_.odometry.came(ros::Time(), at(100.5));
  verdictAt(101.0);
  EXPECT_EQ(value("odometry: rate [1/s]"), "1.0");
  EXPECT_EQ(value("odometry: latency, mean [s]"), "missing");
  health_.odometry.came(at(101.2), at(101.5));
  health_.odometry.came(ros::Time(), at(101.5));
  verdictAt(102.0);
  EXPECT_EQ(value("odometry: latency, mean [s]"), "0.300");
  EXPECT_EQ(value("odometry: latency, longest [s]"), "0.300");
}

TEST_F(HealthTest, TheLastComparisonAndTheAgeOfTheReferenceAreTold) {
  ScanReport reference = scan(ScanOutcome::kReference, 100.0);
  reference.new_reference = true;
  health_.scanTaken(reference);
  ScanReport compared = scan(ScanOutcome::kUpdated, 100.5);
  compared.innovation = Innovation();
  compared.innovation->residual = Eigen::Vector2d(1.0, 2.0);
  compared.innovation->covariance = Eigen::Matrix2d::Identity();
  health_.scanTaken(compared);
  conditions_.newest_odometry = Stamp(std::chrono::milliseconds(100700));
  verdictAt(100.7);
  EXPECT_EQ(value("NIS"), "5.000");
  EXPECT_EQ(value("observed dimension"), "2");
  EXPECT_EQ(value("reference age [s]"), "0.700");
  EXPECT_EQ(value("time of a scan, mean [ms]"), "2.000");
}

TEST_F(HealthTest, TheErrorsOfTheWheelsAreToldWhereTheyAreEstimated) {
  verdictAt(100.5);
  EXPECT_EQ(value("error of the wheels: way [1]"), "missing");
  ScanReport report = scan(ScanOutcome::kUpdated, 100.5);
  report.calibration.error << 0.0312, -0.02, 0.01, 0.07, 0.015, -0.01;
  report.calibration.covariance.diagonal() << 1e-4, 4e-4, 9e-4, 16e-4, 25e-4, 36e-4;
  health_.scanTaken(report);
  verdictAt(100.6);
  EXPECT_EQ(value("error of the wheels: way [1]"), "0.0312 +- 0.0100");
  EXPECT_EQ(value("error of the wheels: rotation [1]"), "-0.0200 +- 0.0200");
  EXPECT_EQ(value("error of the wheels: rotation per meter [rad/m]"), "0.0100 +- 0.0300");
  EXPECT_EQ(value("error of the wheels: laser ahead [m]"), "0.0700 +- 0.0400");
  EXPECT_EQ(value("error of the wheels: floor x [m/m]"), "0.0150 +- 0.0500");
  EXPECT_EQ(value("error of the wheels: floor y [m/m]"), "-0.0100 +- 0.0600");
}

TEST_F(HealthTest, ConstantsOfALaserAreToldWhereTheyAreEstimated) {
  verdictAt(100.5);
  EXPECT_EQ(value("range offset on /scan [m]"), "missing");
  EXPECT_EQ(value("sweep duration on /scan [s]"), "missing");
  ScanReport report = scan(ScanOutcome::kUpdated, 100.5);
  report.laser_constants = {LaserConstant(0.02), LaserConstant(0.01)};
  report.laser_constants.range_offset.add({0.01, 30.0 / 4e-4, 0.0}, 0.0);
  report.laser_constants.sweep_duration.add({0.006, 30.0 / 1e-4, 0.0}, 0.0);
  health_.scanTaken(report);
  verdictAt(100.6);
  EXPECT_EQ(value("range offset on /scan [m]"), "0.0050 +- 0.0141");
  EXPECT_EQ(value("sweep duration on /scan [s]"), "0.0030 +- 0.0071");
}

TEST_F(HealthTest, AnImuThatIsSilentIsAWarningAndNoMore) {
  options_.pipeline.imu.gyro = true;
  health_.imu.came(at(100.0), at(100.0));
  EXPECT_EQ(verdictAt(100.4).level, Level::OK);
  const Verdict verdict = verdictAt(100.8);
  EXPECT_EQ(verdict.level, Level::WARN);
  EXPECT_EQ(verdict.text, "no IMU for 0.8 s (~imu_timeout: 0.5 s): the estimate goes on without it");
}

TEST_F(HealthTest, AHeadingThatContradictsIsAWarningOnce) {
  options_.pipeline.imu.orientation = true;
  ScanReport report = scan(ScanOutcome::kUpdated, 100.1);
  report.heading = HeadingUse::kContradicts;
  report.gyro_bias = {0.01, 4e-6};
  health_.scanTaken(report);
  EXPECT_TRUE(contains(verdictAt(100.2).text, "the orientation of the IMU contradicts"));
  EXPECT_EQ(value("headings: contradicting"), "1");
  EXPECT_EQ(value("gyro bias [rad/s]"), "0.01000 +- 0.00200");
  EXPECT_EQ(verdictAt(100.3).level, Level::OK);
}

TEST_F(HealthTest, AbsolutePosesThatContradictAreAWarningUntilOneDoesNot) {
  options_.pipeline.pose_updates.on = true;
  PoseReport report;
  report.outcome = PoseOutcome::kContradicts;
  for (int i = 0; i < 3; ++i) health_.poseUpdatePassed();
  for (int i = 0; i < 2; ++i) health_.poseUpdateTaken(report);
  EXPECT_TRUE(contains(verdictAt(100.2).text, "the last 2 absolute poses contradict the estimate in map"));
  EXPECT_EQ(value("pose updates: contradicts"), "2");
  EXPECT_EQ(value("pose updates: waiting"), "1");
  report.outcome = PoseOutcome::kUsed;
  health_.poseUpdateTaken(report);
  EXPECT_EQ(verdictAt(100.3).level, Level::OK);
}

}  // namespace
}  // namespace sckf
