// Several lasers on one robot, at their own rates and places.
#include <gmock/gmock.h>

#include <limits>

#include "pipeline/simulated_drive.h"

namespace sckf::test {
namespace {

constexpr std::size_t kFront = 0;
constexpr std::size_t kRear = 1;

/// A fast laser that looks ahead, and a slow one that looks back.
class TwoLasers {
 public:
  TwoLasers() : front_(wheels()), rear_(wheels()) {
    front_.laser = frontLaser();
    rear_.laser = rearLaser();
  }

  /// front: scans at 40 Hz until then; rear: at 5 Hz, each of which comes rear_late ms after its stamp.
  void run(ScanOdometry& pipeline, int to, int front_until, int rear_until, int rear_late) {
    for (int ms = 0; ms <= to; ++ms) {
      if (ms % 20 == 0) pipeline.addOdometry(front_.odometry(ms));
      if (ms % 25 == 3 && ms < front_until) {
        LaserScan scan = front_.scan(ms);
        if (ms >= front_blind_from) scan.ranges.assign(scan.ranges.size(), std::numeric_limits<float>::quiet_NaN());
        pipeline.addScan(scan, front_.laser.base_from_laser, kFront);
      }
      const int taken = ms - rear_late;
      if (taken % 200 == 3 && taken < rear_until) {  // some of them at the very instant of one of the others
        const bool crowd = taken >= rear_crowd_from && taken < rear_crowd_to && taken % 400 == 3;
        const LaserScan scan = crowd ? scanOfACrowd(rear_, taken) : rear_.scan(taken);
        pipeline.addScan(scan, rear_.laser.base_from_laser, kRear);
      }
      for (ScanReport& report : pipeline.process()) {
        if (report.estimate) {
          EXPECT_TRUE(sound(*report.estimate));
          worst = std::max(worst, distance(*report.estimate));
        }
        reports.push_back(std::move(report));
      }
    }
  }

  std::size_t count(std::size_t laser, ScanOutcome outcome) const {
    std::size_t n = 0;
    for (const ScanReport& report : reports) n += report.laser == laser && report.outcome == outcome ? 1 : 0;
    return n;
  }

  SE2 truth(int ms) const { return front_.truth(ms); }
  OdometrySample odometry(int ms) const { return front_.odometry(ms); }

  double distance(const Estimate& estimate) const {
    return error(estimate.odom_from_base, front_.truth(milliseconds(estimate.stamp))).head<2>().norm();
  }

  int front_blind_from = std::numeric_limits<int>::max();  ///< [ms]
  int rear_crowd_from = 0;  ///< [ms] a crowd is behind the robot at every second scan of the rear laser …
  int rear_crowd_to = 0;    ///< [ms] … until here
  std::vector<ScanReport> reports;
  double worst = 0.0;  // [m]

 private:
  static Wheels wheels() { return {}; }

  SimulatedDrive front_;
  SimulatedDrive rear_;
};

PipelineOptions twoLasers() {
  PipelineOptions options;
  options.lasers = 2;
  return options;
}

TEST(Lasers, EachHasItsRateItsMountAndItsReferences) {
  TwoLasers robot;
  ScanOdometry pipeline(twoLasers());
  robot.run(pipeline, 12000, 12000, 12000, 210);
  EXPECT_LT(robot.worst, 0.04);
  EXPECT_EQ(robot.count(kFront, ScanOutcome::kReference), 1U);
  EXPECT_EQ(robot.count(kRear, ScanOutcome::kReference), 1U);
  EXPECT_GT(robot.count(kFront, ScanOutcome::kUpdated), 450U);
  EXPECT_GT(robot.count(kRear, ScanOutcome::kUpdated), 55U);
  for (const ScanOutcome unused : {ScanOutcome::kOutOfOrder, ScanOutcome::kNoOdometry}) {
    EXPECT_EQ(robot.count(kRear, unused), 0U) << "though they come 0.2 s late";
  }
  for (std::size_t i = 1; i < robot.reports.size(); ++i) {
    EXPECT_GE(robot.reports[i].stamp, robot.reports[i - 1].stamp);
  }
}

TEST(Lasers, WithoutPatienceTheSlowOneComesTooLate) {
  PipelineOptions options = twoLasers();
  options.scan_patience = 0.0;
  TwoLasers robot;
  ScanOdometry pipeline(options);
  robot.run(pipeline, 4000, 4000, 4000, 210);
  EXPECT_GT(robot.count(kRear, ScanOutcome::kNoOdometry), 10U) << "odometry of that time is gone";
  EXPECT_LT(robot.worst, 0.04) << "and the other one works on";
}

TEST(Lasers, OneThatFailsLeavesTheOther) {
  for (const bool front_fails : {true, false}) {
    SCOPED_TRACE(front_fails ? "the front one fails" : "the rear one fails");
    TwoLasers robot;
    ScanOdometry pipeline(twoLasers());
    robot.run(pipeline, 12000, front_fails ? 4000 : 12000, front_fails ? 12000 : 4000, 50);
    EXPECT_LT(robot.worst, 0.06);
    const std::size_t other = front_fails ? kRear : kFront;
    EXPECT_GT(robot.count(other, ScanOutcome::kUpdated), front_fails ? 55U : 450U);
    EXPECT_LT(seconds(at(12000) - robot.reports.back().stamp), 0.5) << "nothing waits for what does not come";
  }
}

TEST(Lasers, AScanThatWaitsForOneThatFailsIsNotTooLateForThat) {
  for (const double patience : {1.0, 0.99}) {  // a scan, or odometry, ends it
    PipelineOptions options = twoLasers();
    options.scan_patience = patience;
    options.max_scan_delay = 0.4;
    TwoLasers robot;
    ScanOdometry pipeline(options);
    robot.run(pipeline, 6000, 6000, 1000, 50);
    EXPECT_EQ(robot.count(kFront, ScanOutcome::kNoOdometry), 0U) << patience;
    EXPECT_GT(robot.count(kFront, ScanOutcome::kUpdated), 150U) << patience;
    EXPECT_LT(robot.worst, 0.06);
  }
}

/// Where one is in a crowd now and then, the other tells that the wheels have not slipped.
TEST(Lasers, OneInACrowdDoesNotMakeThePoseUncertain) {
  constexpr int kAlways = 6000;
  constexpr int kNotForLong = 500;
  const auto leastCertain = [](int front_until, int front_sees_until) {
    TwoLasers robot;
    robot.front_blind_from = front_sees_until;
    robot.rear_crowd_from = 2000;
    robot.rear_crowd_to = 6000;
    ScanOdometry pipeline(twoLasers());
    robot.run(pipeline, 6000, front_until, 6000, 50);
    EXPECT_GE(robot.count(kRear, ScanOutcome::kNoMatch) + robot.count(kRear, ScanOutcome::kGated), 10U);
    double largest = 0.0;
    for (const ScanReport& report : robot.reports) {
      if (report.estimate) largest = std::max(largest, std::sqrt(report.estimate->covariance(2, 2)));
    }
    return largest;
  };
  EXPECT_LT(leastCertain(kAlways, kAlways), 0.05);
  EXPECT_GT(leastCertain(kNotForLong, kAlways), 0.4) << "but nobody tells where the other is silent";
  EXPECT_GT(leastCertain(kAlways, kNotForLong), 0.4) << "nor where it sees nothing";
}

TEST(Lasers, OneThatHasNeverBeenHeardIsWaitedForNoLongerThanTheOthers) {
  TwoLasers robot;
  ScanOdometry pipeline(twoLasers());
  robot.run(pipeline, 3000, 3000, 0, 0);
  EXPECT_LT(robot.worst, 0.04);
  EXPECT_GT(robot.count(kFront, ScanOutcome::kUpdated), 100U);
}

TEST(Lasers, BothCorrectTheEstimateInMapToo) {
  PipelineOptions options = twoLasers();
  options.pose_updates.on = true;
  TwoLasers robot;
  ScanOdometry pipeline(options);
  PoseUpdate pose;
  pose.stamp = at(100);
  pose.map_from_base = {robot.truth(100), 1e-6 * Eigen::Matrix3d::Identity()};
  pipeline.addOdometry(robot.odometry(0));
  pipeline.addPose(pose);
  robot.run(pipeline, 8000, 8000, 8000, 0);
  ASSERT_TRUE(robot.reports.back().in_map);
  const SE2 in_map = robot.reports.back().in_map->map_from_base;
  const SE2 truth = robot.truth(milliseconds(robot.reports.back().stamp));
  EXPECT_LT(error(in_map, truth).head<2>().norm(), 0.04);
}

TEST(Lasers, BadOnesAreRefused) {
  PipelineOptions options = twoLasers();
  options.method = "sckf";
  try {
    const ScanOdometry pipeline(options);
    ADD_FAILURE() << "two lasers with one clone";
  } catch (const std::invalid_argument& exception) {
    EXPECT_THAT(exception.what(), testing::HasSubstr("method is \"sckf\""));
  }
  options.lasers = 0;
  EXPECT_THROW(ScanOdometry{options}, std::invalid_argument);
  ScanOdometry pipeline(twoLasers());
  EXPECT_THROW(pipeline.addScan(LaserScan(), Eigen::Isometry3d::Identity(), 2), std::out_of_range);
  EXPECT_THROW(pipeline.setOptions(PipelineOptions()), std::invalid_argument) << "one laser now";
}

}  // namespace
}  // namespace sckf::test
