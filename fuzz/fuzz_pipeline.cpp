// Arbitrary scans and odometry through the pipeline: bytes are read as calls of ScanOdometry, and after each the
// promises are checked. What is broken is thrown, which libFuzzer takes for a crash.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "matching/simulated_world.h"
#include "sckf_odometry/pipeline/scan_odometry.h"

namespace sckf {

namespace {

using test::SimulatedLaser;

constexpr int kMostWaiting = 10;
constexpr double kLongestDelay = 5.0;  // [s] of max_scan_delay

/// Reads values from bytes; zeros when they are at an end.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : data_(data), left_(size) {}

  bool atEnd() const { return left_ == 0; }

  template <typename Value>
  Value any() {
    Value value{};
    const std::size_t n = std::min(sizeof(Value), left_);
    if (n > 0) std::memcpy(&value, data_, n);  // data_ may be null where there is nothing
    data_ += n;
    left_ -= n;
    return value;
  }

  int upTo(int limit) { return any<std::uint8_t>() % (limit + 1); }  ///< the limit itself, too
  bool chance() { return upTo(1) == 1; }

  template <typename Value>
  const Value& oneOf(const std::vector<Value>& values) {
    return values[static_cast<std::size_t>(upTo(static_cast<int>(values.size()) - 1))];
  }

  /// A number of the given size, seldom one of any size or none at all.
  double number(double size) {
    switch (upTo(15)) {
      case 0:
        return any<double>();
      case 1:
        return std::numeric_limits<double>::quiet_NaN();
      case 2:
        return std::numeric_limits<double>::infinity();
      case 3:
        return 0.0;
      default:
        return size * any<std::int16_t>() / 32768.0;
    }
  }

 private:
  const std::uint8_t* data_;
  std::size_t left_;
};

/// A robot on a circle, that no call disturbs.
struct Robot {
  Stamp now = std::chrono::seconds(1000);

  SE2 pose() const {
    const double u = 0.4 * seconds(now - std::chrono::seconds(1000));
    return {std::sin(u), -std::cos(u), u};
  }
};

/// What only one method has.
void switchOthersOn(PipelineOptions& options, Bytes& bytes) {
  const bool can = options.method == "sckf_multi";
  if (bytes.chance()) options.calibration.rotation_std = options.calibration.rotation_per_meter_std = 0.0;
  if (bytes.chance()) options.calibration.distance_std = options.calibration.laser_ahead_std = 0.0;
  options.imu.gyro = can && bytes.chance();
  options.imu.orientation = can && bytes.chance();
  options.pose_updates.on = can && bytes.chance();
  options.standstill.time = can ? 0.2 * bytes.upTo(2) : 0.0;
  options.landmarks.use = can ? bytes.oneOf(landmarkUses()) : "none";
  options.landmarks.only = options.landmarks.on() && bytes.chance();
  options.lasers = can ? 1 + static_cast<std::size_t>(bytes.upTo(2)) : 1;
}

PipelineOptions options(Bytes& bytes) {
  PipelineOptions options;
  options.method = bytes.oneOf(fusionMethodNames());
  options.scans_alone = bytes.chance();
  options.prefer_twist_covariance = bytes.chance();
  options.max_waiting_scans = 1 + bytes.upTo(kMostWaiting - 1);
  options.max_scan_delay = kLongestDelay / (1 + bytes.upTo(9));
  options.odometry_timeout = 0.1 * (1 + bytes.upTo(19));
  options.reference.kf_dist_linear = 0.5 * bytes.upTo(2);
  options.gate.trust_scans_on_slip = bytes.chance();
  options.deskew = bytes.chance();
  options.odometry_noise.model = bytes.oneOf(odometryModelNames());
  options.landmarks.max = 1 + bytes.upTo(9);
  options.scan.max_beams = bytes.chance() ? 60 : 400;
  switchOthersOn(options, bytes);
  return options;
}

void require(bool holds, const std::string& promise) {
  if (!holds) throw std::logic_error(promise);
}

/// Finite, symmetric and positive semi-definite, to the rounding of what has been the largest.
void requireCovariance(const Eigen::Matrix3d& P, const std::string& of) {
  std::ostringstream text;
  text << "covariance of " << of << ":\n" << P;
  require(P.allFinite(), text.str());
  require(P.isApprox(P.transpose(), 1e-9) || P.isZero(0.0), text.str());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(P, Eigen::EigenvaluesOnly);
  require(eigen.eigenvalues().minCoeff() >= -1e-9 * P.cwiseAbs().maxCoeff(), text.str());
}

void requireSound(const Estimate& estimate) {
  std::ostringstream text;
  text << "pose " << estimate.odom_from_base.vector().transpose() << ", twist " << estimate.twist.mean.transpose();
  require(estimate.odom_from_base.vector().allFinite() && estimate.twist.mean.allFinite(), text.str());
  requireCovariance(estimate.covariance, "the pose");
  requireCovariance(estimate.twist.covariance, "the twist");
}

void requireSound(const MapEstimate& estimate) {
  require(estimate.map_from_base.vector().allFinite() && estimate.map_from_odom.vector().allFinite(), "pose in map");
  requireCovariance(estimate.covariance, "the pose in map");
}

class Driver {
 public:
  explicit Driver(Bytes bytes) : bytes_(bytes), pipeline_(options(bytes_)) {}

  void run() {
    for (int calls = 0; !bytes_.atEnd() && calls < 400; ++calls) {
      call();
      check();
    }
  }

 private:
  void call() {
    switch (bytes_.upTo(11)) {
      case 0:
        return pause();
      case 1:
        return addSpoiltOdometry();
      case 2:
        return addSpoiltScan();
      case 3:
        return setPose();
      case 4:
        return setOptions();
      case 5:
        return addImu();
      case 6:
        return addPose();
      case 7:
      case 8:
      case 9:
        return addScan(scan());
      default:
        return drive();
    }
  }

  void drive() {
    for (int i = bytes_.upTo(15); i >= 0; --i) {
      robot_.now += std::chrono::milliseconds(20);
      pipeline_.addOdometry(odometry());
    }
  }

  void pause() { robot_.now += std::chrono::milliseconds(100 * bytes_.upTo(100)); }

  OdometrySample odometry() const {
    OdometrySample sample;
    sample.stamp = robot_.now;
    sample.odom_from_base = compose(driver_origin_, robot_.pose());
    return sample;
  }

  Stamp spoiltStamp() {
    switch (bytes_.upTo(3)) {
      case 0:
        return Stamp(bytes_.any<std::int64_t>());
      case 1:
        return Stamp(0);
      default:
        return robot_.now + std::chrono::milliseconds(bytes_.any<std::int16_t>());
    }
  }

  void addSpoiltOdometry() {
    OdometrySample sample = odometry();
    switch (bytes_.upTo(3)) {
      case 0:
        sample.stamp = spoiltStamp();
        break;
      case 1:
        sample.odom_from_base.x = bytes_.number(10.0);
        sample.odom_from_base.yaw = bytes_.number(4.0);
        break;
      case 2:
        driver_origin_ = inverse(robot_.pose());  // the driver begins anew
        break;
      default:
        sample.twist_covariance = matrix(0.1);
        break;
    }
    pipeline_.addOdometry(sample);
  }

  Eigen::Matrix3d matrix(double size) {
    Eigen::Matrix3d A;
    std::generate(A.data(), A.data() + A.size(), [&] { return bytes_.number(size); });
    return bytes_.chance() ? Eigen::Matrix3d(A * A.transpose()) : A;
  }

  /// Readings of the last tenth of a second, and one of anything.
  void addImu() {
    const SE2 pose = robot_.pose();
    for (int i = 9; i >= 0; --i) pipeline_.addImu({robot_.now - std::chrono::milliseconds(10 * i), 0.4, pose.yaw});
    ImuSample spoilt{spoiltStamp(), bytes_.number(10.0), bytes_.number(10.0)};
    if (bytes_.chance()) spoilt.yaw.reset();
    if (bytes_.chance()) spoilt.yaw_rate.reset();
    pipeline_.addImu(spoilt);
  }

  void addPose() {
    PoseUpdate pose{robot_.now, {robot_.pose(), 0.01 * Eigen::Matrix3d::Identity()}};
    switch (bytes_.upTo(3)) {
      case 0:
        pose.stamp = spoiltStamp();
        break;
      case 1:
        pose.map_from_base.pose = SE2(bytes_.number(100.0), bytes_.number(100.0), bytes_.number(4.0));
        break;
      case 2:
        pose.map_from_base.covariance = matrix(1.0);
        break;
      default:
        break;
    }
    pipeline_.addPose(pose);
  }

  LaserScan scan() const {
    static const test::World world = test::room();
    SimulatedLaser laser;
    laser.beams = 90;
    laser.angle_increment = 2.0 * M_PI / laser.beams;
    laser.time_increment = 0.0005;
    LaserScan scan = simulateScan(world, robot_.pose(), laser);
    scan.stamp = robot_.now;
    return scan;
  }

  void addSpoiltScan() {
    LaserScan scan = this->scan();
    switch (bytes_.upTo(6)) {
      case 0:
        scan.stamp = spoiltStamp();
        break;
      case 1:
        scan.angle_min = bytes_.number(3.0);
        scan.angle_increment = bytes_.number(0.1);
        break;
      case 2:
        scan.range_min = bytes_.number(1.0);
        scan.range_max = bytes_.number(30.0);
        break;
      case 3:
        scan.ranges.resize(static_cast<std::size_t>(bytes_.any<std::uint8_t>()));
        for (float& range : scan.ranges) range = static_cast<float>(bytes_.number(20.0));
        break;
      case 4:
        scan.time_increment = bytes_.number(0.01);
        break;
      case 5:
        scan.ranges.resize(100U * bytes_.any<std::uint8_t>(), scan.ranges.front());
        scan.angle_increment = 6.0 / static_cast<double>(scan.ranges.size() + 1);
        break;
      default:
        for (int i = bytes_.upTo(40); i >= 0; --i) {
          scan.ranges[static_cast<std::size_t>(bytes_.upTo(89))] = static_cast<float>(bytes_.number(20.0));
        }
        break;
    }
    addScan(scan);
  }

  void addScan(const LaserScan& scan) {
    Eigen::Isometry3d mount = Eigen::Isometry3d::Identity();
    if (bytes_.upTo(15) == 0) mount.translation().x() = bytes_.number(2.0);
    if (bytes_.upTo(15) == 0) mount.rotate(Eigen::AngleAxisd(bytes_.number(M_PI), Eigen::Vector3d::UnitX()));
    const int last = static_cast<int>(pipeline_.options().lasers) - 1;
    pipeline_.addScan(scan, mount, static_cast<std::size_t>(bytes_.upTo(last)));
    ++scans_;
  }

  void setPose() {
    const SE2 pose(bytes_.number(100.0), bytes_.number(100.0), bytes_.number(4.0));
    try {
      pipeline_.setPose(pose, matrix(1.0), spoiltStamp());
    } catch (const std::invalid_argument&) {  // as it says
    }
  }

  void setOptions() {
    PipelineOptions changed = options(bytes_);
    changed.method = pipeline_.options().method;
    switchOthersOn(changed, bytes_);
    changed.lasers = pipeline_.options().lasers;
    pipeline_.setOptions(changed);
  }

  void check() {
    for (const ScanReport& report : pipeline_.process()) {
      ++reported_;
      require(report.laser < pipeline_.options().lasers, "a report is of a laser that there is");
      if (report.estimate) requireSound(*report.estimate);
      if (report.in_map) requireSound(*report.in_map);
      require(report.calibration.error.allFinite() && std::isfinite(report.gyro_bias.value), "states are finite");
      if (report.innovation) require(std::isfinite(report.innovation->nis()), "the NIS is finite");
      const bool used = report.outcome == ScanOutcome::kReference || wasUsed(report.outcome);
      require(used == report.reason.empty(), "a scan that is not used has a reason: " + report.reason);
      const bool is_skewed = report.deskewing == Deskewing::kNotTold || report.deskewing == Deskewing::kRefused;
      require(is_skewed == !report.deskewing_problem.empty(),
              "a scan that should be deskewed has a reason if it is not");
    }
    for (const PoseReport& report : pipeline_.takePoseReports()) {
      if (report.in_map) requireSound(*report.in_map);
      const bool used = report.outcome == PoseOutcome::kEntered || report.outcome == PoseOutcome::kUsed;
      require(used == report.reason.empty(), "a pose that is not used has a reason: " + report.reason);
    }
    if (const auto latest = pipeline_.latest()) requireSound(*latest);
    require(scans_ == reported_ + pipeline_.waitingScans(), "every scan is in one report or waits");
    require(pipeline_.waitingScans() <= kMostWaiting, "no more scans wait than may");
    const OdometryBuffer& odometry = pipeline_.odometry();
    if (odometry.size() < 2) return;
    // But for the oldest, from which on it is interpolated.
    const Stamp second = odometry.steps(odometry.oldest(), odometry.newest()).front().to.stamp;
    require(seconds(odometry.newest() - second) <= kLongestDelay, "no more odometry is kept than scans may need");
  }

  Bytes bytes_;
  Robot robot_;
  SE2 driver_origin_;
  ScanOdometry pipeline_;
  std::size_t scans_ = 0;
  std::size_t reported_ = 0;
};

}  // namespace

}  // namespace sckf

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  sckf::Driver(sckf::Bytes(data, size)).run();
  return 0;
}
