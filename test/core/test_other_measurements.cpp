// States that are not cloned, and measurements that are no displacements: whether the covariance can be believed.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <deque>
#include <limits>
#include <string>
#include <tuple>
#include <vector>

#include "chi_squared_band.h"
#include "matrix_matchers.h"
#include "room_simulation.h"
#include "sckf_odometry/core/multi_clone_filter.h"
#include "sckf_odometry/core/odometry_model.h"

namespace sckf {
namespace {

constexpr int kRuns = 200;
constexpr int kScans = 40;
constexpr int kIncrementsPerScan = 4;
constexpr double kDt = 0.05;  // [s] of an increment
constexpr std::size_t kReferences = 3;
constexpr double kNoBound = std::numeric_limits<double>::infinity();

const std::vector<Wall> kRoom{{{1, 0}, 8.0}, {{-1, 0}, 8.0}, {{0, 1}, 7.0}, {{0, -1}, 7.0}};
const std::vector<Wall> kCorridor{{{0, 1}, 2.0}, {{0, -1}, 2.0}};

/// What is switched on, with the noise that it has.
struct Sensors {
  std::vector<Wall> walls = kRoom;
  bool scans = true;
  StateOptions states;
  double gyro_std = 0.0;     // [rad/√s]
  double compass_std = 0.0;  // [rad]
  double pose_std = 0.0;     // [m, rad]
  bool stands = false;       // now and then, and knows that it does
};

Sensors calibration() {
  Sensors sensors;
  sensors.states.calibration_std = Eigen::Vector3d(0.1, 0.1, 0.1);
  sensors.states.calibration_way = 20.0;
  return sensors;
}

Sensors gyro() {
  Sensors sensors;
  sensors.gyro_std = 0.01;
  sensors.states.gyro_bias_std = 0.02;
  sensors.states.gyro_bias_drift = 0.003;
  return sensors;
}

Sensors compass() {
  Sensors sensors;
  sensors.compass_std = 0.03;
  sensors.states.heading_drift = 0.005;
  return sensors;
}

Sensors poses() {
  Sensors sensors;
  sensors.pose_std = 0.1;
  return sensors;
}

Sensors standing() {
  Sensors sensors;
  sensors.stands = true;
  return sensors;
}

Sensors everything() {
  Sensors sensors = calibration();
  sensors.gyro_std = gyro().gyro_std;
  sensors.states.gyro_bias_std = gyro().states.gyro_bias_std;
  sensors.states.gyro_bias_drift = gyro().states.gyro_bias_drift;
  sensors.compass_std = compass().compass_std;
  sensors.states.heading_drift = compass().states.heading_drift;
  sensors.pose_std = poses().pose_std;
  sensors.stands = true;
  return sensors;
}

OdometryNoise wheelNoise() {
  OdometryNoise noise;
  noise.translation_per_meter = 0.05;
  noise.translation_per_radian = 0.02;
  noise.yaw_per_meter = 0.05;
  noise.yaw_per_radian = 0.10;
  return noise;
}

/// Squared normalised errors, means over the runs, one entry per scan.
struct Statistics {
  std::vector<double> pose = std::vector<double>(kScans + 1, 0.0);
  std::vector<double> calibration = pose;
  std::vector<double> bias = pose;
  std::vector<double> squared_error = pose;        // [m²] of the position
  std::vector<double> squared_calibration = pose;  // of the scale of distance
};

/// A robot, what its sensors err by, and the filter that is told how much that is.
class Robot {
 public:
  Robot(const Sensors& sensors, std::uint64_t seed)
      : sensors_(sensors),
        random_(seed),
        room_(sensors.walls, 0.03),
        filter_(corrected(truth_, random_.drawnFrom(kStart)), kStart, sensors.states) {
    calibration_ = sensors.states.calibration_std.cwiseProduct(Eigen::Vector3d(random_.gaussian(3)));
    bias_ = sensors.states.gyro_bias_std * one();
    compass_from_world_ = random_.uniform(-3.0, 3.0);
    references_.push_back(room_.scan(truth_, random_));
    filter_.clone(references_.front().variance);
  }

  void run(Statistics& sums) {
    for (int scan = 1; scan <= kScans; ++scan) {
      for (int i = 0; i < kIncrementsPerScan; ++i) step(kIncrementsPerScan * scan + i);
      if (sensors_.scans) compareScan(scan);
      note(scan, sums);
    }
  }

 private:
  double one() { return random_.gaussian(1)(0, 0); }

  void step(int number) {
    const bool stands = sensors_.stands && number % 20 < 6;
    const Eigen::Matrix3d standing_noise = 1e-8 * Eigen::Matrix3d::Identity();
    SE2 truth = stands ? SE2(random_.drawnFrom(standing_noise)) : SE2();
    OdometryIncrement increment =
        stands ? jitterAbout(truth) : drive(SE2(0.06, 0.0, 0.05 * std::cos(0.1 * number)), truth);
    if (sensors_.gyro_std > 0.0) {
      MotionMeasurement z{Eigen::RowVector3d(0, 0, 1), Innovation::Vector(1), Displacement::MatrixDD(1, 1), kDt};
      z.noise << sensors_.gyro_std * sensors_.gyro_std * kDt;
      z.value << truth.yaw + bias_ * kDt + std::sqrt(z.noise(0, 0)) * one();
      increment.measured.push_back(z);
    }
    if (stands) {
      increment.measured.push_back({Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero(), standing_noise, 0.0});
    }
    filter_.propagate(increment);
    filter_.age(kDt);
    truth_ = compose(truth_, truth);
    drift(increment.before_from_after.translation().norm());
    if (sensors_.compass_std > 0.0) {
      const double yaw = truth_.yaw + compass_from_world_ + sensors_.compass_std * one();
      filter_.updateHeading(yaw, sensors_.compass_std * sensors_.compass_std, kNoBound);
    }
    if (sensors_.pose_std > 0.0 && number % 7 == 0) measurePose();  // in between scans, too
  }

  /// The wheels turn as they say; what the robot does differs by their systematic errors and by noise.
  OdometryIncrement drive(const SE2& by_wheels, SE2& truth) {
    const OdometryIncrement increment = modelledIncrement(by_wheels, wheelNoise());
    const auto& [s, r, k] = std::tie(calibration_(0), calibration_(1), calibration_(2));
    const double way = by_wheels.translation().norm();
    truth = corrected(SE2((1.0 + s) * by_wheels.x, (1.0 + s) * by_wheels.y, (1.0 + r) * by_wheels.yaw + k * way),
                      random_.drawnFrom(increment.covariance));
    return increment;
  }

  /// Wheels that tell of motion while the robot stands.
  OdometryIncrement jitterAbout(const SE2& truth) {
    const Eigen::Matrix3d Q = 1e-4 * Eigen::Matrix3d::Identity();
    return {corrected(truth, random_.drawnFrom(Q)), Q, false};
  }

  void drift(double way) {
    const double kept = std::exp(-way / sensors_.states.calibration_way);
    const Eigen::Vector3d std = std::sqrt(1.0 - kept * kept) * sensors_.states.calibration_std;
    calibration_ = kept * calibration_ + std.cwiseProduct(Eigen::Vector3d(random_.gaussian(3)));
    bias_ += std::sqrt(kDt) * sensors_.states.gyro_bias_drift * one();
    compass_from_world_ += std::sqrt(kDt) * sensors_.states.heading_drift * one();
  }

  void measurePose() {
    const Eigen::Matrix3d R = sensors_.pose_std * sensors_.pose_std * Eigen::Matrix3d::Identity();
    if (!placed_) {  // somewhere else in the world than the filter thought
      const SE2 d = random_.pose(300.0);
      const SE2 before = truth_;
      truth_ = compose(d, truth_);
      compass_from_world_ -= d.yaw;
      world_from_room_ = compose(truth_, inverse(before));
      filter_.enterWorld({corrected(truth_, random_.drawnFrom(R)), R});
      placed_ = true;
      return;
    }
    filter_.update({corrected(truth_, random_.drawnFrom(R)), R}, kNoBound);
  }

  void compareScan(int number) {
    const SimulatedScan current = room_.scan(compose(inverse(world_from_room_), truth_), random_);
    const bool new_reference = number % 2 == 0;
    for (std::size_t i = 0; i < (new_reference ? references_.size() : 1); ++i) {
      Displacement z = room_.match(references_[i], current, random_);
      z.clone = i;
      filter_.update(z, filter_.innovation(z));
    }
    if (!new_reference) return;
    filter_.clone(current.variance);
    references_.push_front(current);
    if (references_.size() <= kReferences) return;
    references_.pop_back();
    filter_.forget(kReferences);
  }

  void note(int scan, Statistics& sums) const {
    const auto nees = [](const Eigen::Vector3d& e, const Eigen::Matrix3d& P) {
      return e.dot(P.llt().solve(e)) / kRuns;
    };
    const auto at = static_cast<std::size_t>(scan);
    const Eigen::Vector3d e = error(truth_, filter_.pose());
    sums.pose[at] += nees(e, filter_.covariance());
    sums.squared_error[at] += e.head<2>().squaredNorm() / kRuns;
    const WheelCalibration calibration = filter_.calibration();
    if (!calibration.covariance.isZero()) {
      sums.calibration[at] += nees(calibration_ - calibration.error, calibration.covariance);
      sums.squared_calibration[at] += std::pow(calibration_(0) - calibration.error(0), 2) / kRuns;
    }
    if (filter_.gyroBias().variance > 0.0) {
      sums.bias[at] += std::pow(bias_ - filter_.gyroBias().value, 2) / filter_.gyroBias().variance / kRuns;
    }
  }

  static inline const Eigen::Matrix3d kStart = 1e-6 * Eigen::Matrix3d::Identity();

  Sensors sensors_;
  RandomInputs random_;
  RoomSimulation room_;
  SE2 truth_{0.0, -1.0, 0.0};
  MultiCloneFilter filter_;
  Eigen::Vector3d calibration_;
  double bias_ = 0.0;
  double compass_from_world_ = 0.0;
  SE2 world_from_room_;
  bool placed_ = false;
  std::deque<SimulatedScan> references_;
};

Statistics simulate(const Sensors& sensors) {
  Statistics sums;
  for (int i = 0; i < kRuns; ++i) Robot(sensors, 2000U + static_cast<std::uint64_t>(i)).run(sums);
  return sums;
}

void expectInBand(const std::vector<double>& means, int d, const std::string& what) {
  expectInBand(means, ChiSquaredBand(d, kRuns), what);
}

TEST(OtherMeasurements, SystematicErrorsOfTheWheelsAreFound) {
  const Statistics with = simulate(calibration());
  expectInBand(with.pose, 3, "pose");
  expectInBand(with.calibration, 3, "calibration");
  EXPECT_LT(std::sqrt(with.squared_calibration[kScans]), 0.5 * 0.1) << "scale of distance, 0.1 if it were not found";
}

TEST(OtherMeasurements, AlongACorridorTheCalibrationIsAllThereIs) {
  Sensors sensors = calibration();
  sensors.walls = kCorridor;
  const Statistics with = simulate(sensors);
  expectInBand(with.pose, 3, "pose");
  expectInBand(with.calibration, 3, "calibration");
}

TEST(OtherMeasurements, AGyroAndItsBias) {
  Sensors sensors = gyro();
  const Statistics with = simulate(sensors);
  expectInBand(with.pose, 3, "pose");
  expectInBand(with.bias, 1, "bias");
  sensors.scans = false;
  const Statistics blind = simulate(sensors);
  expectInBand(blind.pose, 3, "pose without scans");
  sensors.gyro_std = 0.0;
  EXPECT_LT(blind.squared_error[kScans], 0.7 * simulate(sensors).squared_error[kScans]) << "with it, and without";
}

TEST(OtherMeasurements, ACompassWhoseZeroIsNotKnown) {
  Sensors sensors = compass();
  expectInBand(simulate(sensors).pose, 3, "pose");
  sensors.scans = false;
  expectInBand(simulate(sensors).pose, 3, "pose without scans");
}

TEST(OtherMeasurements, PosesInAnotherWorld) { expectInBand(simulate(poses()).pose, 3, "pose"); }

TEST(OtherMeasurements, ARobotThatKnowsThatItStands) {
  Sensors sensors = standing();
  expectInBand(simulate(sensors).pose, 3, "pose");
  sensors.gyro_std = gyro().gyro_std;
  sensors.states = gyro().states;
  const Statistics with = simulate(sensors);
  expectInBand(with.pose, 3, "pose with a gyro");
  expectInBand(with.bias, 1, "bias");
}

TEST(OtherMeasurements, AllTogether) {
  const Statistics with = simulate(everything());
  expectInBand(with.pose, 3, "pose");
  expectInBand(with.calibration, 3, "calibration");
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
  OdometryIncrement slip = modelledIncrement(SE2(0.02, 0.0, 0.2), wheelNoise());
  MotionMeasurement z{Eigen::RowVector3d(0, 0, 1), Innovation::Vector(1), Displacement::MatrixDD(1, 1), 0.1};
  z.value << 0.01;
  z.noise << 1e-6;
  slip.measured.push_back(z);
  const OdometryIncrement refined = filter.refined(slip);
  filter.propagate(slip);
  EXPECT_NEAR(filter.pose().yaw, 0.01, 0.005);
  EXPECT_NEAR(filter.gyroBias().value, 0.0, 0.003);
  EXPECT_NEAR(refined.before_from_after.yaw, filter.pose().yaw, 1e-9) << "what is published in between agrees";
}

TEST(OtherMeasurements, WhatIsRefinedIsWhatIsPropagated) {
  RandomInputs random(95);
  StateOptions states = everything().states;
  MultiCloneFilter filter(SE2(), 1e-9 * Eigen::Matrix3d::Identity(), states);
  OdometryIncrement increment = random.increment(0.05);
  MotionMeasurement z{Eigen::RowVector3d(0, 0, 1), Innovation::Vector(1), Displacement::MatrixDD(1, 1), 0.1};
  z.value << increment.before_from_after.yaw + 0.02;
  z.noise << 1e-4;
  increment.measured.push_back(z);
  const OdometryIncrement refined = filter.refined(increment);
  filter.propagate(increment);
  const Eigen::Vector3d moved = filter.pose().vector();
  EXPECT_TRUE(matricesNear(refined.before_from_after.vector(), moved, 2e-3)) << "but for the second order";
  EXPECT_TRUE(matricesClose(refined.covariance, filter.covariance(), 1e-2));
}

TEST(OtherMeasurements, TheCalibrationForgetsAndNeverRunsAway) {
  const StateOptions states = calibration().states;
  MultiCloneFilter filter(SE2(), 1e-9 * Eigen::Matrix3d::Identity(), states);
  const Eigen::VectorXd R = Eigen::VectorXd::Constant(1, 1e-8);
  const auto drive = [&](double scale, int steps) {  // wheels that say 0.2 m where it is so many times as much
    for (int i = 0; i < steps; ++i) {
      filter.clone(R);
      if (filter.clones() > 1) filter.forget(1);
      filter.propagate(modelledIncrement(SE2(0.2, 0.0, 0.0), wheelNoise()));
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
    filter.propagate(modelledIncrement(SE2(0.5, 0.0, 0.0), wheelNoise()));  // nothing to see
  EXPECT_NEAR(filter.calibration().error(0), 0.0, 0.01) << "five times the way within which it forgets";
  EXPECT_NEAR(filter.calibration().covariance(0, 0), 0.01, 1e-4) << "as uncertain as at the start, and no more";
}

}  // namespace
}  // namespace sckf
