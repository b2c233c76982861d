#include "sckf_odometry/experiments/other_measurements.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <deque>
#include <limits>
#include <tuple>

#include "sckf_odometry/core/multi_clone_filter.h"
#include "sckf_odometry/experiments/pose_nees.h"

namespace sckf {

namespace {

constexpr int kIncrementsPerScan = 4;
constexpr double kDt = 0.05;  // [s] of an increment
constexpr std::size_t kReferences = 3;
constexpr double kNoBound = std::numeric_limits<double>::infinity();

StateOptions estimated(const SimulatedSensors& sensors) {
  StateOptions states = sensors.states;
  if (!sensors.calibrated) states.calibration_std.setZero();
  return states;
}

/// A robot, what its sensors err by, and the filter that is told how much that is.
class Robot {
 public:
  Robot(const SimulatedSensors& sensors, std::uint64_t seed)
      : sensors_(sensors),
        random_(seed),
        room_(sensors.walls, 0.03),
        filter_(corrected(truth_, random_.drawnFrom(kStart)), kStart, estimated(sensors)) {
    calibration_ = sensors.states.calibration_std.cwiseProduct(
        WheelCalibration::Vector(random_.gaussian(WheelCalibration::kErrors)));
    bias_ = sensors.states.gyro_bias_std * random_.gaussian();
    compass_from_world_ = random_.uniform(-3.0, 3.0);
    references_.push_back(room_.scan(truth_, random_));
    filter_.clone(references_.front().variance);
  }

  /// One of so many robots; the first one leaves a trace.
  void run(int scans, int runs, bool traced, SensorStatistics& sums) {
    for (int scan = 1; scan <= scans; ++scan) {
      for (int i = 0; i < kIncrementsPerScan; ++i) step(kIncrementsPerScan * scan + i);
      if (scan <= sensors_.scans_until) compareScan(scan);
      note(static_cast<std::size_t>(scan), runs, sums);
      if (traced) trace(sums);
    }
  }

 private:
  void trace(SensorStatistics& sums) const {
    const auto add = [](TracedState& trace, double truth, double estimate, double variance) {
      trace.truth.push_back(truth);
      trace.estimate.push_back(estimate);
      trace.std.push_back(std::sqrt(variance));
    };
    const WheelCalibration calibration = filter_.calibration();
    add(sums.traced_bias, bias_, filter_.gyroBias().value, filter_.gyroBias().variance);
    add(sums.traced_scale, calibration_(0), calibration.error(0), calibration.covariance(0, 0));
  }

  void step(int number) {
    const bool stands = sensors_.stands && number % 20 < 6;
    const Eigen::Matrix3d standing_noise = 1e-8 * Eigen::Matrix3d::Identity();
    SE2 truth = stands ? SE2(random_.drawnFrom(standing_noise)) : SE2();
    OdometryIncrement increment =
        stands ? jitterAbout(truth) : drive(SE2(0.06, 0.0, 0.05 * std::cos(0.1 * number)), truth);
    if (sensors_.gyro_std > 0.0) {
      MotionMeasurement z{Eigen::RowVector3d(0, 0, 1), Innovation::Vector(1), Displacement::MatrixDD(1, 1), kDt};
      z.noise << sensors_.gyro_std * sensors_.gyro_std * kDt;
      z.value << truth.yaw + bias_ * kDt + std::sqrt(z.noise(0, 0)) * random_.gaussian();
      increment.measured.push_back(z);
    }
    if (stands && sensors_.knows_that_it_stands) {
      increment.measured.push_back({Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero(), standing_noise, 0.0});
    }
    filter_.propagate(increment);
    filter_.age(kDt);
    truth_ = compose(truth_, truth);
    drift(increment.before_from_after.translation().norm());
    if (sensors_.compass_std > 0.0) {
      const double yaw = truth_.yaw + compass_from_world_ + sensors_.compass_std * random_.gaussian();
      filter_.updateHeading(yaw, sensors_.compass_std * sensors_.compass_std, kNoBound);
    }
    if (sensors_.pose_std > 0.0 && number % 7 == 0) measurePose();  // in between scans, too
  }

  /// The wheels turn as they say; what the robot does differs by their systematic errors and by noise.
  OdometryIncrement drive(const SE2& by_wheels, SE2& truth) {
    const OdometryIncrement increment = modelledIncrement(by_wheels, simulatedWheelNoise());
    const auto& [s, r, k, l] = std::tie(calibration_(0), calibration_(1), calibration_(2), calibration_(3));
    const auto& [x, y, yaw] = by_wheels;
    const Eigen::Vector2d along = std::hypot(x, y) * (truth_.rotation().transpose() * calibration_.tail<2>());
    truth = corrected(SE2((1.0 + s) * x - l * (1.0 - std::cos(yaw)) + along.x(),
                          (1.0 + s) * y + l * std::sin(yaw) + along.y(), (1.0 + r) * yaw + k * std::hypot(x, y)),
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
    const WheelCalibration::Vector std = std::sqrt(1.0 - kept * kept) * sensors_.states.calibration_std;
    calibration_ =
        kept * calibration_ + std.cwiseProduct(WheelCalibration::Vector(random_.gaussian(WheelCalibration::kErrors)));
    bias_ += std::sqrt(kDt) * sensors_.states.gyro_bias_drift * random_.gaussian();
    compass_from_world_ += std::sqrt(kDt) * sensors_.states.heading_drift * random_.gaussian();
  }

  void measurePose() {
    const Eigen::Matrix3d R = sensors_.pose_std * sensors_.pose_std * Eigen::Matrix3d::Identity();
    if (!placed_) {  // somewhere else in the world than the filter thought
      const SE2 d(random_.uniform(-300.0, 300.0), random_.uniform(-300.0, 300.0), random_.uniform(-M_PI, M_PI));
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

  void note(std::size_t scan, int runs, SensorStatistics& sums) const {
    const auto nees = [runs](const Eigen::VectorXd& e, const Eigen::MatrixXd& P) {
      return e.dot(P.llt().solve(e)) / runs;
    };
    const Eigen::Vector3d e = error(truth_, filter_.pose());
    const Eigen::Matrix3d P = filter_.covariance();
    sums.pose[scan] += poseNees(truth_, filter_.pose(), P) / runs;
    sums.squared_error[scan] += e.head<2>().squaredNorm() / runs;
    sums.squared_yaw[scan] += e.z() * e.z() / runs;
    sums.variance[scan] += P.topLeftCorner<2, 2>().trace() / runs;
    const WheelCalibration calibration = filter_.calibration();
    if (!calibration.covariance.isZero()) {
      sums.calibration[scan] += nees(calibration_ - calibration.error, calibration.covariance);
      sums.squared_calibration[scan] += std::pow(calibration_(0) - calibration.error(0), 2) / runs;
    }
    if (const GyroBias found = filter_.gyroBias(); found.variance > 0.0) {
      const double squared = std::pow(bias_ - found.value, 2);
      sums.bias[scan] += squared / found.variance / runs;
      sums.squared_bias[scan] += squared / runs;
    }
  }

  static inline const Eigen::Matrix3d kStart = 1e-6 * Eigen::Matrix3d::Identity();

  SimulatedSensors sensors_;
  RandomDraws random_;
  RoomSimulation room_;
  SE2 truth_{0.0, -1.0, 0.0};
  MultiCloneFilter filter_;
  WheelCalibration::Vector calibration_;
  double bias_ = 0.0;
  double compass_from_world_ = 0.0;
  SE2 world_from_room_;
  bool placed_ = false;
  std::deque<SimulatedScan> references_;
};

}  // namespace

OdometryNoise simulatedWheelNoise() {
  OdometryNoise noise;
  noise.translation_per_meter = 0.05;
  noise.translation_per_radian = 0.02;
  noise.yaw_per_meter = 0.05;
  noise.yaw_per_radian = 0.10;
  return noise;
}

SimulatedSensors wheelsThatErr() {
  SimulatedSensors sensors;
  sensors.states.calibration_std << 0.1, 0.1, 0.1, 0.1, 0.05, 0.05;
  sensors.states.calibration_way = 20.0;
  return sensors;
}

SimulatedSensors gyro() {
  SimulatedSensors sensors;
  sensors.gyro_std = 0.01;
  sensors.states.gyro_bias_std = 0.02;
  sensors.states.gyro_bias_drift = 0.003;
  return sensors;
}

SimulatedSensors compass() {
  SimulatedSensors sensors;
  sensors.compass_std = 0.03;
  sensors.states.heading_drift = 0.005;
  return sensors;
}

SimulatedSensors absolutePoses() {
  SimulatedSensors sensors;
  sensors.pose_std = 0.1;
  return sensors;
}

SimulatedSensors standingNowAndThen() {
  SimulatedSensors sensors;
  sensors.stands = true;
  return sensors;
}

SimulatedSensors everySensor() {
  SimulatedSensors sensors = gyro();
  sensors.states.calibration_std = wheelsThatErr().states.calibration_std;
  sensors.states.calibration_way = wheelsThatErr().states.calibration_way;
  sensors.compass_std = compass().compass_std;
  sensors.states.heading_drift = compass().states.heading_drift;
  sensors.pose_std = absolutePoses().pose_std;
  sensors.stands = true;
  return sensors;
}

SensorStatistics::SensorStatistics(int scans) {
  for (auto* means :
       {&pose, &calibration, &bias, &squared_error, &squared_yaw, &squared_calibration, &squared_bias, &variance}) {
    means->assign(static_cast<std::size_t>(scans) + 1, 0.0);
  }
}

SensorStatistics simulateOtherMeasurements(const SimulatedSensors& sensors, const OtherMeasurementsOptions& options) {
  SensorStatistics sums(options.scans);
  for (int i = 0; i < options.runs; ++i) {
    Robot robot(sensors, options.seed + static_cast<std::uint64_t>(i));
    robot.run(options.scans, options.runs, i == 0, sums);
  }
  return sums;
}

}  // namespace sckf
