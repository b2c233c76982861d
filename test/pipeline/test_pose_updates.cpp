// Absolute poses: an estimate in map that they correct, beside the one in odom that they do not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>
#include <vector>

#include "core/random_inputs.h"
#include "pipeline/simulated_drive.h"

namespace sckf::test {
namespace {

const SE2 kMapFromOdom(10.0, -5.0, 1.0);
constexpr double kStd = 0.05;  // [m, rad]

PipelineOptions withPoses() {
  PipelineOptions options;
  options.pose_updates.on = true;
  return options;
}

/// A drive with absolute poses now and then.
class InMap : public Driven {
 public:
  explicit InMap(const SimulatedDrive& drive, const PipelineOptions& options = withPoses())
      : Driven(drive, options), drive_(drive) {
    odometry(0);
  }

  SE2 truth(int ms) const { return compose(kMapFromOdom, drive_.truth(ms)); }

  /// Where the robot was at that time, but for noise, or by so much off.
  void pose(int ms, const SE2& off = SE2()) {
    const Eigen::Matrix3d R = kStd * kStd * Eigen::Matrix3d::Identity();
    pipeline.addPose({at(ms), {compose(corrected(truth(ms), random_.drawnFrom(R)), off), R}});
    take();
  }

  void take() {
    process();
    for (const PoseReport& report : pipeline.takePoseReports()) poses.push_back(report);
  }

  /// As run(), with a pose each second at the scan's stamp.
  void drive(int from, int to) {
    for (int ms = from; ms < to; ms += 1000) {
      run(ms, ms + 1000);
      pose(ms + 907);
    }
  }

  std::vector<PoseOutcome> outcomes() const {
    std::vector<PoseOutcome> outcomes;
    for (const PoseReport& report : poses) outcomes.push_back(report.outcome);
    return outcomes;
  }

  std::vector<PoseReport> poses;

 private:
  const SimulatedDrive& drive_;
  RandomInputs random_{7};
};

double nees(const MapEstimate& estimate, const SE2& truth) {
  const Eigen::Vector3d e = error(truth, estimate.map_from_base);
  return e.dot(estimate.covariance.llt().solve(e));
}

TEST(PoseUpdates, TheEstimateInMapIsWhereTheyAre) {
  const SimulatedDrive drive;
  InMap driven(drive);
  driven.drive(0, 15000);
  EXPECT_FALSE(driven.reports.front().in_map) << "before the first pose";
  ASSERT_EQ(driven.poses.size(), 15U);
  EXPECT_EQ(driven.poses[0].outcome, PoseOutcome::kEntered);
  for (std::size_t i = 1; i < 15; ++i) EXPECT_EQ(driven.poses[i].outcome, PoseOutcome::kUsed);
  const MapEstimate& last = driven.poses.back().in_map.value();
  EXPECT_EQ(last.stamp, at(14907));
  EXPECT_LT(nees(last, driven.truth(14907)), 16.3) << error(driven.truth(14907), last.map_from_base).transpose();
  EXPECT_LT(std::sqrt(last.covariance(0, 0)), 0.7 * kStd) << "many poses tell more than one";
  EXPECT_LT(
      error(compose(last.map_from_odom, driven.reports.back().estimate->odom_from_base), last.map_from_base).norm(),
      1e-9);
}

void expectSameInOdom(const Driven& one, const Driven& other) {
  ASSERT_EQ(one.reports.size(), other.reports.size());
  for (std::size_t i = 0; i < one.reports.size(); ++i) {
    expectNear(one.reports[i].estimate.value(), other.reports[i].estimate.value(), 0.0);
  }
}

TEST(PoseUpdates, TheEstimateInOdomIsWhatItIsWithoutThem) {
  const SimulatedDrive drive;
  InMap with(drive);
  with.drive(0, 8000);
  Driven without(drive);
  without.odometry(0);
  without.run(0, 8000);
  expectSameInOdom(with, without);
  const Estimate before = with.pipeline.latest().value();
  with.pose(7957, SE2(0.1, 0.1, 0.1));
  with.pipeline.addPose({at(7907), {SE2(1, 2, 3), 1e-4 * Eigen::Matrix3d::Identity()}});
  with.take();
  expectNear(with.pipeline.latest().value(), before, 0.0);
}

TEST(PoseUpdates, LandmarksLeadTheEstimateInMapAsTheyLeadThatInOdom) {
  Wheels wheels;
  wheels.yaw_per_meter = 0.1;
  const SimulatedDrive drive(wheels);
  PipelineOptions options;
  options.landmarks.use = "corners";
  options.landmarks.only = true;
  options.landmarks.max_std = 0.5;  // the wheels alone lead from one to the next
  Driven without(drive, options);
  without.odometry(0);
  options.pose_updates.on = true;
  InMap with(drive, options);
  for (int ms = 0; ms < 15000; ms += 1000) {
    without.run(ms, ms + 1000);
    with.run(ms, ms + 1000);
    if (ms == 4000 || ms == 5000) with.pose(ms + 907);  // landmarks that are known by then, and others later
  }
  expectSameInOdom(with, without);
  const ScanReport& last = with.reports.back();
  ASSERT_GT(last.landmarks_used, 0);
  const SE2 truth = with.truth(milliseconds(last.stamp));
  const MapEstimate& in_map = last.in_map.value();
  EXPECT_LT(nees(in_map, truth), 16.3) << error(truth, in_map.map_from_base).transpose();
  EXPECT_LT(error(truth, in_map.map_from_base).head<2>().norm(), 3.0 * kStd);
}

TEST(PoseUpdates, WithoutScansTheyHoldTheRobotInMapAlone) {
  Wheels wheels;
  wheels.yaw_per_meter = 0.2;
  const SimulatedDrive drive(wheels);
  PipelineOptions options = withPoses();
  options.scan.min_points = 1000;  // no scan can be used
  InMap driven(drive, options);
  driven.drive(0, 15000);
  const Eigen::Vector3d odom_error = error(driven.reports.back().estimate->odom_from_base, drive.truth(14907));
  EXPECT_GT(odom_error.head<2>().norm(), 0.5) << "the drive is no test: the wheels are good enough";
  const MapEstimate& last = driven.poses.back().in_map.value();
  EXPECT_LT(error(last.map_from_base, driven.truth(14907)).head<2>().norm(), 4.0 * kStd);
}

TEST(PoseUpdates, ThoseThatContradictAreNotUsedUntilTheyAreTooMany) {
  const SimulatedDrive drive;
  InMap driven(drive);
  driven.drive(0, 3000);
  const SE2 carried_off(3.0, 0.0, 0.0);
  for (int i = 0; i < 10; ++i) {
    driven.run(3000 + 200 * i, 3200 + 200 * i);
    driven.pose(3107 + 200 * i, carried_off);
    const PoseReport& report = driven.poses.back();
    EXPECT_GT(report.nis, report.nis_bound);
    EXPECT_EQ(report.outcome, i < 9 ? PoseOutcome::kContradicts : PoseOutcome::kEntered);
    if (i < 9) {
      EXPECT_THAT(report.reason, testing::HasSubstr("exceeds"));
      EXPECT_LT(error(report.in_map->map_from_base, driven.truth(3107 + 200 * i)).norm(), 0.2);
    }
  }
  const SE2 there = compose(driven.truth(4907), carried_off);
  EXPECT_LT(error(driven.poses.back().in_map->map_from_base, there).norm(), 0.6) << "kStd, and its yaw over 3 m";
  driven.run(5000, 5200);
  driven.pose(5107, carried_off);
  EXPECT_EQ(driven.poses.back().outcome, PoseOutcome::kUsed);
}

TEST(PoseUpdates, OneThatComesLateIsBroughtForward) {
  const SimulatedDrive drive;
  InMap in_time(drive);
  InMap late(drive);
  for (InMap* driven : {&in_time, &late}) driven->drive(0, 3000);
  in_time.run(3000, 3100);
  in_time.pose(3007);
  in_time.run(3100, 4000);
  late.run(3000, 4000);
  late.pose(3007);
  ASSERT_EQ(late.poses.back().outcome, PoseOutcome::kUsed);
  EXPECT_EQ(late.poses.back().stamp, at(3007));
  in_time.run(4000, 4020);
  late.run(4000, 4020);
  const MapEstimate& a = in_time.reports.back().in_map.value();
  const MapEstimate& b = late.reports.back().in_map.value();
  EXPECT_EQ(a.stamp, b.stamp);
  EXPECT_LT(error(a.map_from_base, b.map_from_base).norm(), 0.02);
  EXPECT_GT(b.covariance(0, 0), a.covariance(0, 0)) << "the way since is not known exactly";
}

TEST(PoseUpdates, OneWhoseTimeIsForgottenIsNotUsed) {
  const SimulatedDrive drive;
  InMap driven(drive);
  driven.drive(0, 9000);
  driven.pose(1007);
  EXPECT_EQ(driven.poses.back().outcome, PoseOutcome::kTooLate);
  EXPECT_FALSE(driven.poses.back().reason.empty());
}

TEST(PoseUpdates, TheyWaitForScansThatAreOlder) {
  const SimulatedDrive drive;
  InMap driven(drive);
  driven.run(0, 1000);
  driven.odometry(1020);
  driven.odometry(1040);
  driven.pose(1030);
  EXPECT_TRUE(driven.poses.empty());
  driven.scan(1007);
  EXPECT_EQ(driven.reports.back().outcome, ScanOutcome::kUpdated);
  EXPECT_TRUE(driven.poses.empty());
  driven.run(1040, 1120);
  driven.take();
  EXPECT_EQ(driven.outcomes(), std::vector<PoseOutcome>{PoseOutcome::kEntered});
}

TEST(PoseUpdates, TheyDoNotWaitForEver) {
  const SimulatedDrive drive;
  PipelineOptions options = withPoses();
  options.max_scan_delay = 1.0;
  InMap driven(drive, options);
  for (int ms = 20; ms <= 1000; ms += 20) driven.odometry(ms);
  driven.pose(510);
  EXPECT_TRUE(driven.poses.empty());
  for (int ms = 1020; ms <= 1600; ms += 20) driven.odometry(ms);
  driven.take();
  ASSERT_EQ(driven.poses.size(), 1U);
  EXPECT_EQ(driven.poses[0].in_map->stamp, at(510));
}

TEST(PoseUpdates, WithoutOdometryTheyAreGivenUpOldestFirst) {
  ScanOdometry pipeline(withPoses());
  for (int i = 0; i < 1002; ++i) pipeline.addPose({at(i), {SE2(), Eigen::Matrix3d::Identity()}});
  pipeline.process();
  const std::vector<PoseReport> reports = pipeline.takePoseReports();
  ASSERT_EQ(reports.size(), 2U);
  EXPECT_EQ(reports[0].outcome, PoseOutcome::kNoOdometry);
  EXPECT_EQ(reports[0].stamp, at(0));
  EXPECT_EQ(reports[1].stamp, at(1));
}

TEST(PoseUpdates, ARobotThatIsPutElsewhereInOdomIsInMapAfterTheNextOne) {
  const SimulatedDrive drive;
  InMap driven(drive);
  driven.drive(0, 3000);
  driven.pipeline.setPose(SE2(7, 7, 2), Eigen::Matrix3d::Zero(), at(3000));
  driven.run(3000, 3200);
  EXPECT_FALSE(driven.reports.back().in_map);
  driven.pose(3107);
  EXPECT_EQ(driven.poses.back().outcome, PoseOutcome::kEntered);
  EXPECT_LT(error(driven.poses.back().in_map->map_from_base, driven.truth(3107)).norm(), 0.3);
}

TEST(PoseUpdates, WhatIsNoPoseIsNotUsed) {
  const SimulatedDrive drive;
  InMap driven(drive);
  driven.drive(0, 3000);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Eigen::Matrix3d R = 1e-2 * Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d exact = Eigen::Vector3d(1e-2, 0.0, 1e-2).asDiagonal();
  Eigen::Matrix3d skew = R;
  skew(0, 1) = 1e-3;
  const std::vector<PoseUpdate> none{{at(2957), {SE2(nan, 0.0, 0.0), R}}, {at(2957), {SE2(1e300, 0.0, 0.0), R}},
                                     {at(2957), {SE2(), nan * R}},        {at(2957), {SE2(), -R}},
                                     {at(2957), {SE2(), exact}},          {at(2957), {SE2(), skew}},
                                     {Stamp(-1), {driven.truth(2957), R}}};
  for (const PoseUpdate& pose : none) {
    driven.pipeline.addPose(pose);
    driven.take();
    EXPECT_EQ(driven.poses.back().outcome, PoseOutcome::kNoPose);
    EXPECT_THAT(driven.poses.back().reason, testing::HasSubstr("positive definite"));
  }
  driven.run(3000, 3200);
  EXPECT_LT(error(driven.reports.back().in_map->map_from_base, driven.truth(3107)).norm(), 0.2);
}

}  // namespace
}  // namespace sckf::test
