// The pipeline when all is well: accuracy, methods and mounts, references, what is published between scans.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <limits>
#include <stdexcept>

#include "core/matrix_matchers.h"
#include "pipeline/simulated_drive.h"

namespace sckf::test {
namespace {

// ---- accuracy -------------------------------------------------------------------------------------------------------

TEST(ScanOdometry, FollowsTheTruthWhereTheWheelsDoNot) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.odometry(0);
  driven.run(0, 15000);
  EXPECT_EQ(driven.reports.size(), 150U);
  EXPECT_EQ(driven.count(ScanOutcome::kReference), 1U);
  EXPECT_EQ(driven.count(ScanOutcome::kUpdated), 149U);
  expectAccurate(drive, driven);
  const Eigen::Vector3d wheels = error(drive.wheels(15000), drive.truth(15000));
  EXPECT_GT(wheels.head<2>().norm(), 0.2) << "the drive is no test: the wheels are good enough";
}

TEST(ScanOdometry, FollowsTheTruthWhateverTheLasersMount) {
  using Eigen::AngleAxisd;
  using Eigen::Translation3d;
  using Eigen::Vector3d;
  SimulatedDrive drive;
  const std::vector<std::pair<const char*, Eigen::Isometry3d>> mounts{
      {"0.5 m ahead", Eigen::Isometry3d(Translation3d(0.5, 0.0, 0.3))},
      {"turned by 90 degrees", Translation3d(0.0, 0.1, 0.3) * AngleAxisd(M_PI_2, Vector3d::UnitZ())},
      {"upside down", Translation3d(0.1, 0.0, 1.0) * AngleAxisd(M_PI, Vector3d::UnitX())}};
  for (const auto& [name, mount] : mounts) {
    SCOPED_TRACE(name);
    drive.laser.base_from_laser = mount;
    Driven driven(drive);
    driven.odometry(0);
    driven.run(0, 8000);
    EXPECT_EQ(driven.count(ScanOutcome::kUpdated), 79U);
    expectAccurate(drive, driven);
  }
}

TEST(ScanOdometry, EveryMethodRuns) {
  const SimulatedDrive drive;
  for (const std::string& method : fusionMethodNames()) {
    SCOPED_TRACE(method);
    Driven driven(drive, withMethod(method));
    driven.odometry(0);
    driven.run(0, 6000);
    EXPECT_EQ(driven.reports.size(), 60U);
    const Eigen::Vector3d truth_error = driven.latestError(6000);
    if (method == "dead_reckoning") {
      const Eigen::Vector3d e = error(driven.pipeline.latest()->odom_from_base, drive.wheels(6000));
      EXPECT_LT(e.cwiseAbs().maxCoeff(), 1e-3) << "off the wheels by " << e.transpose();
    } else {
      EXPECT_LT(truth_error.head<2>().norm(), 0.06) << truth_error.transpose();
      EXPECT_LT(std::abs(truth_error.z()), 0.03) << truth_error.transpose();
    }
  }
}

TEST(ScanOdometry, AnUnknownMethodIsRefusedByNameWithTheKnownOnes) {
  try {
    ScanOdometry{withMethod("kalman")};
    FAIL() << "not refused";
  } catch (const std::invalid_argument& refusal) {
    EXPECT_THAT(refusal.what(), testing::HasSubstr("\"kalman\""));
    for (const std::string& name : fusionMethodNames()) EXPECT_THAT(refusal.what(), testing::HasSubstr(name));
  }
}

// ---- between scans --------------------------------------------------------------------------------------------------

TEST(ScanOdometry, TheFirstScanBecomesTheReference) {
  const SimulatedDrive drive;
  Driven driven(drive);
  driven.odometry(0);
  driven.run(0, 200);
  ASSERT_EQ(driven.reports.size(), 2U);
  const ScanReport& first = driven.reports[0];
  EXPECT_EQ(first.outcome, ScanOutcome::kReference);
  EXPECT_TRUE(first.new_reference);
  EXPECT_FALSE(first.innovation);
  ASSERT_NE(first.scan, nullptr);
  EXPECT_EQ(first.scan->size(), 361U);
  const ScanReport& second = driven.reports[1];
  EXPECT_EQ(second.outcome, ScanOutcome::kUpdated);
  EXPECT_EQ(second.reference_stamp, at(7));
  EXPECT_FALSE(second.new_reference);
  ASSERT_TRUE(second.match.displacement);
  const SE2 truth = between(drive.truth(7), drive.truth(107));
  const Eigen::Vector3d e = error(second.match.displacement->reference_from_current, truth);
  EXPECT_LT(e.cwiseAbs().maxCoeff(), 0.01) << e.transpose();
}

TEST(ScanOdometry, AReferenceIsKeptOverSeveralScansUnlessTheDistancesAreZero) {
  const SimulatedDrive drive;
  for (const bool every_scan : {false, true}) {
    PipelineOptions options;
    if (every_scan) options.reference.kf_dist_linear = options.reference.kf_dist_angular = 0.0;
    Driven driven(drive, options);
    driven.odometry(0);
    driven.run(0, 6000);
    std::size_t references = 0;
    for (const ScanReport& report : driven.reports) references += report.new_reference ? 1 : 0;
    if (every_scan) {
      EXPECT_EQ(references, 60U);
    } else {
      EXPECT_LT(references, 15U);
      EXPECT_GT(references, 2U);
    }
    expectAccurate(drive, driven);
  }
}

/// At the rate of odometry: by the wheels' own increment from one to the next, with a covariance that grows, and at a
/// scan on by the wheels from the scan's estimate.
TEST(ScanOdometry, TheLatestEstimateGoesOnFromTheScansByTheWheels) {
  const SimulatedDrive drive;
  PipelineOptions options;
  options.calibration = noCalibration();
  Driven driven(drive, options);
  driven.odometry(0);
  EXPECT_EQ(driven.pipeline.latest()->stamp, at(0));
  EXPECT_TRUE(driven.pipeline.latest()->odom_from_base.vector().isZero(0.0));
  for (int ms = 20; ms <= 5000; ms += 20) {
    const Estimate before = driven.pipeline.latest().value();
    driven.odometry(ms);
    const Estimate after = driven.pipeline.latest().value();
    EXPECT_EQ(after.stamp, at(ms));
    const SE2 moved = compose(before.odom_from_base, between(drive.wheels(ms - 20), drive.wheels(ms)));
    const Eigen::Vector3d off = error(after.odom_from_base, moved);
    EXPECT_LT(off.cwiseAbs().maxCoeff(), 1e-12) << off.transpose() << " at " << ms;
    EXPECT_GT(after.covariance.determinant(), before.covariance.determinant()) << "at " << ms;
    if (ms % 100 != 20) continue;
    driven.scan(ms - 13);  // 7 ms after the sample before
    const Estimate at_scan = driven.reports.back().estimate.value();
    const Estimate corrected = driven.pipeline.latest().value();
    const SE2 on = compose(at_scan.odom_from_base, between(drive.wheels(ms - 13), drive.wheels(ms)));
    EXPECT_LT(error(corrected.odom_from_base, on).cwiseAbs().maxCoeff(), 1e-4) << "at " << ms;
    EXPECT_LT(error(corrected.odom_from_base, after.odom_from_base).head<2>().norm(), 0.03) << "at " << ms;
    EXPECT_GT(corrected.covariance.determinant(), at_scan.covariance.determinant()) << "at " << ms;
  }
}

// ---- covariance stated by the driver --------------------------------------------------------------------------------

/// The covariance after one step of 20 ms, whose message brings this twist covariance.
Eigen::Matrix3d afterOneStep(const std::optional<Eigen::Matrix3d>& stated, bool prefer) {
  const SimulatedDrive drive;
  PipelineOptions options;
  options.prefer_twist_covariance = prefer;
  options.calibration = noCalibration();
  ScanOdometry pipeline(options);
  pipeline.addOdometry(drive.odometry(0));
  OdometrySample sample = drive.odometry(20);
  sample.twist_covariance = stated;
  pipeline.addOdometry(sample);
  EXPECT_TRUE(sound(pipeline.latest().value()));
  return pipeline.latest()->covariance;
}

TEST(ScanOdometry, TheStatedTwistCovarianceIsUsedIfPreferred) {
  const Eigen::Matrix3d stated = Eigen::Vector3d(0.04, 0.01, 0.09).asDiagonal();
  EXPECT_TRUE(matricesNear(afterOneStep(stated, true), stated * 0.02 * 0.02, 1e-15));
  EXPECT_TRUE(matricesNear(afterOneStep(stated, false), afterOneStep(std::nullopt, false), 0.0));
}

TEST(ScanOdometry, AStatedTwistCovarianceThatIsNoneGivesWayToTheModel) {
  const Eigen::Matrix3d model = afterOneStep(std::nullopt, true);
  EXPECT_GT(model.determinant(), 0.0);
  Eigen::Matrix3d negative = 1e-2 * Eigen::Matrix3d::Identity();
  negative(2, 2) = -1.0;
  Eigen::Matrix3d not_a_number = 1e-2 * Eigen::Matrix3d::Identity();
  not_a_number(0, 1) = std::numeric_limits<double>::quiet_NaN();
  Eigen::Matrix3d not_symmetric = 1e-2 * Eigen::Matrix3d::Identity();
  not_symmetric(0, 1) = 5e-3;
  const Eigen::Matrix3d unknown = 1e6 * Eigen::Matrix3d::Identity();
  for (const Eigen::Matrix3d& none :
       {Eigen::Matrix3d(Eigen::Matrix3d::Zero()), negative, not_a_number, not_symmetric, unknown}) {
    EXPECT_TRUE(matricesNear(afterOneStep(none, true), model, 0.0)) << "stated:\n" << none;
  }
}

}  // namespace
}  // namespace sckf::test
