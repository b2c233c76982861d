// States that are not cloned, and measurements that are no displacements: whether the covariance can be believed.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "core/chi_squared_band.h"
#include "core/matrix_matchers.h"
#include "core/random_inputs.h"
#include "sckf_odometry/core/multi_clone_filter.h"
#include "sckf_odometry/experiments/other_measurements.h"

namespace sckf {
namespace {

constexpr OtherMeasurementsOptions kOptions;

SensorStatistics simulate(const SimulatedSensors& sensors) { return simulateOtherMeasurements(sensors, kOptions); }

/// At the origin, with what the pipeline estimates of wheels and laser by default.
MultiCloneFilter withWheelsThatMayErr() {
  StateOptions states;
  states.calibration_std << 0.02, 0.05, 0.05, 0.1, 0.01, 0.01;
  states.calibration_way = 1000.0;
  return MultiCloneFilter(SE2(), Eigen::Matrix3d::Zero(), states);
}

void expectInBand(const std::vector<double>& means, int d, const std::string& what) {
  expectInBand(means, ChiSquaredBand(d, kOptions.runs), what);
}

TEST(OtherMeasurements, SystematicErrorsOfTheWheelsAreFound) {
  const SensorStatistics with = simulate(wheelsThatErr());
  expectInBand(with.pose, 3, "pose");
  expectInBand(with.calibration, WheelCalibration::kErrors, "calibration");
  EXPECT_LT(std::sqrt(with.squared_calibration.back()), 0.5 * 0.1) << "scale of distance, 0.1 if it were not found";
}

TEST(OtherMeasurements, AlongACorridorTheCalibrationIsAllThereIs) {
  SimulatedSensors sensors = wheelsThatErr();
  sensors.walls = simulatedCorridor();
  const SensorStatistics with = simulate(sensors);
  expectInBand(with.pose, 3, "pose");
  expectInBand(with.calibration, WheelCalibration::kErrors, "calibration");
}

TEST(OtherMeasurements, AGyroAndItsBias) {
  SimulatedSensors sensors = gyro();
  const SensorStatistics with = simulate(sensors);
  expectInBand(with.pose, 3, "pose");
  expectInBand(with.bias, 1, "bias");
  sensors.scans_until = 0;
  const SensorStatistics blind = simulate(sensors);
  expectInBand(blind.pose, 3, "pose without scans");
  sensors.gyro_std = 0.0;
  EXPECT_LT(blind.squared_error.back(), 0.7 * simulate(sensors).squared_error.back()) << "with it, and without";
}

TEST(OtherMeasurements, ACompassWhoseZeroIsNotKnown) {
  SimulatedSensors sensors = compass();
  expectInBand(simulate(sensors).pose, 3, "pose");
  sensors.scans_until = 0;
  expectInBand(simulate(sensors).pose, 3, "pose without scans");
}

TEST(OtherMeasurements, PosesInAnotherWorld) { expectInBand(simulate(absolutePoses()).pose, 3, "pose"); }

TEST(OtherMeasurements, ARobotThatKnowsThatItStands) {
  SimulatedSensors sensors = standingNowAndThen();
  expectInBand(simulate(sensors).pose, 3, "pose");
  sensors.gyro_std = gyro().gyro_std;
  sensors.states = gyro().states;
  const SensorStatistics with = simulate(sensors);
  expectInBand(with.pose, 3, "pose with a gyro");
  expectInBand(with.bias, 1, "bias");
}

TEST(OtherMeasurements, AllTogether) {
  const SensorStatistics with = simulate(everySensor());
  expectInBand(with.pose, 3, "pose");
  expectInBand(with.calibration, WheelCalibration::kErrors, "calibration");
  expectInBand(with.bias, 1, "bias");
}

TEST(OtherMeasurements, WhatContradictsIsNotUsed) {
  MultiCloneFilter filter(SE2(1.0, 2.0, 0.3), 1e-4 * Eigen::Matrix3d::Identity());
  const SE2 before = filter.pose();
  EXPECT_GT(filter.update({SE2(2.0, 2.0, 0.3), 1e-4 * Eigen::Matrix3d::Identity()}, 16.0), 16.0);
  filter.updateHeading(1.0, 1e-6, 10.0);  // the first one tells where the compass has its zero
  EXPECT_GT(filter.updateHeading(1.5, 1e-6, 10.0), 10.0);
  EXPECT_EQ(error(filter.pose(), before).norm(), 0.0);
  EXPECT_LT(filter.update({SE2(1.01, 2.0, 0.3), 1e-4 * Eigen::Matrix3d::Identity()}, 16.0), 16.0);
  EXPECT_GT(error(filter.pose(), before).norm(), 1e-3);
}

TEST(OtherMeasurements, WheelsThatSlipAreNotBelievedAgainstTheGyro) {
  StateOptions states;
  states.gyro_bias_std = 0.001;
  MultiCloneFilter filter(SE2(), 1e-8 * Eigen::Matrix3d::Identity(), states);
  OdometryIncrement slip = modelledIncrement(SE2(0.02, 0.0, 0.2), simulatedWheelNoise());
  MotionMeasurement z{Eigen::RowVector3d(0, 0, 1), Innovation::Vector(1), Displacement::MatrixDD(1, 1), 0.1};
  z.value << 0.01;
  z.noise << 1e-6;
  slip.measured.push_back(z);
  const OdometryIncrement refined = filter.refined(slip, 0.0);
  filter.propagate(slip);
  EXPECT_NEAR(filter.pose().yaw, 0.01, 0.005);
  EXPECT_NEAR(filter.gyroBias().value, 0.0, 0.003);
  EXPECT_NEAR(refined.before_from_after.yaw, filter.pose().yaw, 1e-9) << "what is published in between agrees";
}

TEST(OtherMeasurements, WhatIsRefinedIsWhatIsPropagated) {
  RandomInputs random(95);
  StateOptions states = everySensor().states;
  MultiCloneFilter filter(SE2(), 1e-9 * Eigen::Matrix3d::Identity(), states);
  OdometryIncrement increment = random.increment(0.05);
  MotionMeasurement z{Eigen::RowVector3d(0, 0, 1), Innovation::Vector(1), Displacement::MatrixDD(1, 1), 0.1};
  z.value << increment.before_from_after.yaw + 0.02;
  z.noise << 1e-4;
  increment.measured.push_back(z);
  const OdometryIncrement refined = filter.refined(increment, 0.0);
  filter.propagate(increment);
  const Eigen::Vector3d moved = filter.pose().vector();
  EXPECT_TRUE(matricesNear(refined.before_from_after.vector(), moved, 2e-3)) << "but for the second order";
  EXPECT_TRUE(matricesClose(refined.covariance, filter.covariance(), 1e-2));
}

TEST(OtherMeasurements, TheCalibrationForgetsAndNeverRunsAway) {
  const StateOptions states = wheelsThatErr().states;
  MultiCloneFilter filter(SE2(), 1e-9 * Eigen::Matrix3d::Identity(), states);
  const Eigen::VectorXd R = Eigen::VectorXd::Constant(1, 1e-8);
  const auto drive = [&](double scale, int steps) {  // wheels that say 0.2 m where it is so many times as much
    for (int i = 0; i < steps; ++i) {
      filter.clone(R);
      if (filter.clones() > 1) filter.forget(1);
      filter.propagate(modelledIncrement(SE2(0.2, 0.0, 0.0), simulatedWheelNoise()));
      Displacement z;
      z.reference_from_current = SE2(0.2 * scale, 0.0, 0.0);
      z.J_reference = z.J_current = Eigen::MatrixXd::Zero(3, 1);
      z.variance_reference = z.variance_current = R;
      z.matching_noise = 1e-6 * Eigen::Matrix3d::Identity();
      filter.update(z, filter.innovation(z));
    }
  };
  drive(1.08, 200);
  EXPECT_NEAR(filter.calibration().error(0), 0.08, 0.03);
  for (int i = 0; i < 200; ++i)
    filter.propagate(modelledIncrement(SE2(0.5, 0.0, 0.0), simulatedWheelNoise()));  // nothing to see
  EXPECT_NEAR(filter.calibration().error(0), 0.0, 0.01) << "five times the way within which it forgets";
  EXPECT_NEAR(filter.calibration().covariance(0, 0), 0.01, 1e-4) << "as uncertain as at the start, and no more";
}

/// And to a hundredth of a radian, by matching noise alone.
Displacement seenToACentimetre(const SE2& reference_from_current) {
  Displacement z;
  z.reference_from_current = reference_from_current;
  z.J_reference = z.J_current = Eigen::MatrixXd::Zero(3, 0);
  z.variance_reference = z.variance_current = Eigen::VectorXd(0);
  z.matching_noise = 1e-4 * Eigen::Matrix3d::Identity();
  return z;
}

TEST(OtherMeasurements, OneErrorOfTheWheelsAloneIsEstimatedWhereTheOthersHaveNoStd) {
  const SE2 start(0.0, 0.0, 0.3);
  const SE2 told(1.0, 0.0, 0.5);
  WheelCalibration::Jacobian B;  // of the motion, by the scale of the way, of rotations, …, by the floor in x and y
  B.row(0) << 1.0, 0.0, 0.0, std::cos(0.5) - 1.0, std::cos(0.3), std::sin(0.3);
  B.row(1) << 0.0, 0.0, 0.0, std::sin(0.5), -std::sin(0.3), std::cos(0.3);
  B.row(2) << 0.0, 0.5, 1.0, 0.0, 0.0, 0.0;
  for (Eigen::Index i = 0; i < WheelCalibration::kErrors; ++i) {
    SCOPED_TRACE("error " + std::to_string(i));
    StateOptions states;
    states.calibration_std(i) = 0.05;
    states.calibration_way = 1e12;
    MultiCloneFilter filter(start, Eigen::Matrix3d::Zero(), states);
    filter.clone(Eigen::VectorXd(0));
    filter.propagate({told, 4e-4 * Eigen::Matrix3d::Identity()});
    const Displacement z = seenToACentimetre(corrected(told, B.col(i) * 0.04));
    filter.update(z, filter.innovation(z));
    const double signal = 25e-4 * B.col(i).squaredNorm();
    const double gain = signal / (signal + 4e-4 + 1e-4);  // beside noise of the wheels and of the displacement
    const WheelCalibration found = filter.calibration();
    EXPECT_TRUE(matricesNear(found.error, WheelCalibration::Vector::Unit(i) * 0.04 * gain, 1e-12));
    WheelCalibration::Matrix covariance = WheelCalibration::Matrix::Zero();
    covariance(i, i) = 25e-4 * (1.0 - gain);
    EXPECT_TRUE(matricesNear(found.covariance, covariance, 1e-12));
  }
}

TEST(OtherMeasurements, BeginWithWhatIsKnownOfThem) {
  StateOptions states = everySensor().states;
  states.calibration_std << 0.02, 0.0, 0.05, 0.1, 0.01, 0.01;  // of rotations there is no error
  WheelCalibration known;
  known.error << 0.01, 0.3, -0.02, 0.05, 0.01, -0.02;
  known.covariance.diagonal() << 1e-4, 1e-4, 4e-4, 9e-4, 16e-4, 25e-4;
  states.known_calibration = known;
  states.known_gyro_bias = GyroBias{0.004, 1e-6};
  const MultiCloneFilter filter(SE2(), Eigen::Matrix3d::Zero(), states);
  WheelCalibration expected = known;
  expected.error(1) = 0.0;
  expected.covariance(1, 1) = 0.0;
  EXPECT_TRUE(matricesNear(filter.calibration().error, expected.error, 1e-15));
  EXPECT_TRUE(matricesNear(filter.calibration().covariance, expected.covariance, 1e-15));
  EXPECT_EQ(filter.gyroBias().value, 0.004);
  EXPECT_NEAR(filter.gyroBias().variance, 1e-6, 1e-18);
}

/// A carpet lies where it lies, whatever its direction is called in another world.
TEST(OtherMeasurements, WhatTheFloorDoesIsTurnedWithTheWorld) {
  StateOptions states;
  states.calibration_std << 0.0, 0.0, 0.0, 0.1, 0.01, 0.01;
  WheelCalibration known;
  known.error << 0.0, 0.0, 0.0, 0.05, 0.01, 0.02;
  known.covariance.diagonal() << 0.0, 0.0, 0.0, 1e-4, 4e-6, 9e-6;
  states.known_calibration = known;
  MultiCloneFilter filter(SE2(3.0, 1.0, 0.2), 1e-6 * Eigen::Matrix3d::Identity(), states);
  filter.enterWorld({SE2(-7.0, 2.0, 0.2 + M_PI / 2.0), 1e-6 * Eigen::Matrix3d::Identity()});
  const WheelCalibration there = filter.calibration();
  EXPECT_TRUE(matricesNear(there.error, (WheelCalibration::Vector() << 0, 0, 0, 0.05, -0.02, 0.01).finished(), 1e-9));
  WheelCalibration::Vector variances;
  variances << 0.0, 0.0, 0.0, 1e-4, 9e-6, 4e-6;
  EXPECT_TRUE(matricesNear(there.covariance.diagonal(), variances, 1e-9)) << "but for what the yaw there errs by";
  EXPECT_TRUE(matricesNear(there.error, known.turned(M_PI / 2.0).error, 1e-9));
  EXPECT_TRUE(matricesNear(there.covariance, known.turned(M_PI / 2.0).covariance, 1e-9));
}

/// A map that is entered with a wrong yaw: what corrects that later turns the carpet, too.
TEST(OtherMeasurements, AYawThatIsCorrectedLaterTurnsWhatTheFloorDoes) {
  StateOptions states;
  states.calibration_std << 0.0, 0.0, 0.0, 0.0, 0.01, 0.01;
  states.calibration_way = 1e12;
  WheelCalibration known;
  known.error << 0.0, 0.0, 0.0, 0.0, 0.02, 0.0;
  known.covariance.diagonal() << 0.0, 0.0, 0.0, 0.0, 1e-6, 1e-6;
  states.known_calibration = known;
  MultiCloneFilter filter(SE2(), 1e-6 * Eigen::Matrix3d::Identity(), states);
  constexpr double kWrong = 0.26;  // [rad]
  filter.enterWorld({SE2(0.0, 0.0, kWrong), Eigen::Vector3d(1e-4, 1e-4, kWrong * kWrong).asDiagonal()});
  EXPECT_NEAR(filter.calibration().error(5), 0.02 * std::sin(kWrong), 1e-9) << "as if it lay there";
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  for (int i = 1; i <= 20; ++i) {
    filter.propagate({SE2(0.5, 0.0, 0.0), 1e-6 * Eigen::Matrix3d::Identity()});
    const SE2 truth(0.5 * i * 1.02, 0.0, 0.0);
    filter.update(PoseMeasurement{truth, Eigen::Vector3d(1e-4, 1e-4, 100.0).asDiagonal()}, kInfinite);
  }
  EXPECT_NEAR(filter.calibration().error(4), 0.02, 0.001);
  EXPECT_NEAR(filter.calibration().error(5), 0.0, 0.001);
}

/// Carried there or found to have drifted: the carpet lies where it lay, or is turned with the estimate.
TEST(OtherMeasurements, OfARobotThatIsToldToFaceElsewhereTheFloorIsLessCertain) {
  WheelCalibration here;
  here.error << 0.01, 0.02, 0.03, 0.04, 0.015, 0.0;
  here.covariance.diagonal() << 1e-4, 1e-4, 1e-4, 1e-4, 9e-6, 9e-6;
  const WheelCalibration same = here.turnedWithTheRobot(0.0);
  EXPECT_TRUE(matricesNear(same.error, here.error, 0.0));
  EXPECT_TRUE(matricesNear(same.covariance, here.covariance, 0.0));
  const WheelCalibration back = here.turnedWithTheRobot(M_PI);
  EXPECT_TRUE(matricesNear(back.error.head<4>(), here.error.head<4>(), 0.0));
  EXPECT_NEAR(back.error(4), -0.015, 1e-12);
  EXPECT_NEAR(back.covariance(4, 4), 9e-6 + 0.5 * 0.03 * 0.03, 1e-12);
  EXPECT_NEAR(back.covariance(0, 0), 1e-4, 1e-18);
}

/// One wheel is larger than the other: what that turns the robot by on its way ahead it turns it back by when it
/// reverses, where there is nothing to see.
TEST(OtherMeasurements, WhatWheelsTurnTheRobotByAheadTheyTurnItBackInReverse) {
  constexpr double kTurn = 0.05;  // [rad/m]
  MultiCloneFilter filter = withWheelsThatMayErr();
  SE2 truth;
  const auto drive = [&](double way) {
    truth = compose(truth, SE2(way, 0.0, kTurn * way));
    filter.propagate(modelledIncrement(SE2(way, 0.0, 0.0), {}));
  };
  for (int i = 0; i < 100; ++i) {
    filter.clone(Eigen::VectorXd(0));
    if (filter.clones() > 1) filter.forget(1);
    const SE2 reference = truth;
    drive(0.2);
    const Displacement z = seenToACentimetre(between(reference, truth));
    filter.update(z, filter.innovation(z));
  }
  for (int i = 0; i < 50; ++i) drive(-0.2);
  EXPECT_LT(std::abs(error(filter.pose(), truth).z()), 0.25 * kTurn * 10.0)
      << "the wheels alone would be off by all of it";
}

/// A robot that comes by wheels to where it sees first, 30 m on, and then slips by half a radian: what it did is seen
/// to a centimetre. That tells of the wheels, too, which led the robot all the way.
TEST(OtherMeasurements, WhatIsLearnedOfTheWheelsDoesNotTurnTheWayBehind) {
  MultiCloneFilter filter = withWheelsThatMayErr();
  const Eigen::Matrix3d Q = Eigen::Vector3d(1e-3, 1e-3, 1e-3).asDiagonal();
  for (int i = 0; i < 100; ++i) filter.propagate({SE2(0.3, 0.0, 0.01), Q});
  filter.clone(Eigen::VectorXd(0));
  const SE2 reference = filter.pose();
  filter.propagate({SE2(0.7, 0.0, -0.4), 10.0 * Q});
  const Displacement z = seenToACentimetre(SE2(0.7, 0.0, 0.1));
  filter.update(z, filter.innovation(z));
  EXPECT_GT(filter.calibration().error.cwiseAbs().maxCoeff(), 0.02) << "the slip is no test: nothing is learned";
  const Eigen::Vector3d off = error(filter.predictedDisplacement().reference_from_current, z.reference_from_current);
  EXPECT_LT(off.head<2>().norm(), 0.05) << off.transpose();
  EXPECT_LT(std::abs(off.z()), 0.02);
  EXPECT_TRUE(matricesNear(between(reference, filter.pose()).vector(),
                           filter.predictedDisplacement().reference_from_current.vector(), 1e-9))
      << "the reference has not moved";
}

/// It comes by wheels to where it sees first, 100 m on. Then it sees each step from the references before, whose scans
/// have noise in common: nothing of that tells where it has come from.
TEST(OtherMeasurements, DisplacementsDoNotTurnTheWayBehindHoweverFarTheWheelsLed) {
  RandomInputs random(29);
  MultiCloneFilter filter = withWheelsThatMayErr();
  const OdometryIncrement step{SE2(0.5, 0.0, 0.0), Eigen::Vector3d(1e-3, 1e-3, 5e-3).asDiagonal()};
  const Eigen::VectorXd R = Eigen::VectorXd::Constant(4, 1e-3);
  for (int i = 0; i < 200; ++i) filter.propagate(step);
  filter.clone(R);
  const SE2 first = filter.pose();
  for (int scan = 1; scan <= 10; ++scan) {
    filter.propagate(step);
    for (std::size_t clone = 0; clone < filter.clones(); ++clone) {
      Displacement z = random.displacement(SE2(0.5 * static_cast<double>(clone + 1), 0.0, 0.0), 3, R, R, 0.02);
      z.clone = clone;
      filter.update(z, filter.innovation(z));
    }
    filter.clone(R);
  }
  const Eigen::Vector3d moved = error(filter.clonedPose(filter.clones() - 1), first);
  EXPECT_LT(moved.head<2>().norm(), 0.05) << moved.transpose();
  EXPECT_LT(std::abs(moved.z()), 0.02) << moved.z();
}

/// It stands, and each scan is compared with the same reference: the second tells of the reference's noise nothing new.
TEST(OtherMeasurements, ARobotThatStandsDoesNotFollowTheNoiseOfEachScan) {
  constexpr double kNoise = 0.01;  // [m] of a range
  RandomInputs random(31);
  MultiCloneFilter filter = withWheelsThatMayErr();
  const OdometryIncrement step{SE2(0.5, 0.0, 0.1), Eigen::Vector3d(1e-3, 1e-3, 5e-3).asDiagonal()};
  const Eigen::VectorXd R = Eigen::VectorXd::Constant(4, kNoise * kNoise);
  const Eigen::MatrixXd J = 0.5 * random.gaussian(3, 4);
  const auto seen = [&](const SE2& displacement, const Eigen::VectorXd& reference, const Eigen::VectorXd& current) {
    const Eigen::Vector3d noise = J * (reference - current);
    Displacement z = random.displacement(displacement, 3, R, R, 1e-3);
    z.reference_from_current = corrected(displacement, noise);
    z.observable.setIdentity();
    z.J_reference = -J;
    z.J_current = J;
    return z;
  };
  Eigen::VectorXd reference = kNoise * random.gaussian(4, 1);
  filter.clone(R);
  for (int scan = 0; scan < 10; ++scan) {
    filter.propagate(step);
    const Eigen::VectorXd current = kNoise * random.gaussian(4, 1);
    const Displacement z = seen(SE2(0.5, 0.0, 0.1), reference, current);
    filter.update(z, filter.innovation(z));
    filter.clone(R);
    filter.forget(1);
    reference = current;
  }
  double squared = 0.0;
  SE2 before;
  for (int scan = 0; scan < 100; ++scan) {
    filter.propagate({SE2(), Eigen::Matrix3d::Zero()});
    const Displacement z = seen(SE2(), reference, kNoise * random.gaussian(4, 1));
    filter.update(z, filter.innovation(z));
    if (scan >= 50) squared += error(filter.pose(), before).head<2>().squaredNorm() / 50;
    before = filter.pose();
  }
  EXPECT_LT(std::sqrt(squared), 0.1 * kNoise) << "[m] from scan to scan";
}

}  // namespace
}  // namespace sckf
