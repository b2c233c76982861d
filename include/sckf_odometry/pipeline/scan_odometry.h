// The whole way of a scan: odometry and scans in, estimates out. No middleware's type in it; the nodelet and the
// offline replay drive this very class.
#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sckf_odometry/core/dead_reckoning.h"
#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/pipeline/displacement_updates.h"
#include "sckf_odometry/pipeline/imu_buffer.h"
#include "sckf_odometry/pipeline/landmarks.h"
#include "sckf_odometry/pipeline/laser_constants.h"
#include "sckf_odometry/pipeline/no_return.h"
#include "sckf_odometry/pipeline/odometry_buffer.h"
#include "sckf_odometry/pipeline/pipeline_options.h"
#include "sckf_odometry/pipeline/pose_updates.h"
#include "sckf_odometry/pipeline/scan_report.h"
#include "sckf_odometry/pipeline/standstill.h"
#include "sckf_odometry/pipeline/twist_window.h"
#include "sckf_odometry/pipeline/waiting_scans.h"

namespace sckf {

/// What an estimate has found of wheels, floor, gyro and lasers, wherever the robot is: for one in the same odom frame
/// that begins after it.
struct Found {
  std::optional<WheelCalibration> calibration;
  std::optional<GyroBias> gyro_bias;
  std::vector<LaserConstants> lasers;  ///< one for each; or none
};

class ScanOdometry {
 public:
  /// The estimate starts at a pose, with a covariance: symmetric, positive semi-definite. Throws std::invalid_argument
  /// with name, value and what is expected as check(options) does, and if pose or covariance are none. before: what an
  /// estimate with the same options has found().
  explicit ScanOdometry(const PipelineOptions& options, const SE2& odom_from_base = SE2(),
                        const Eigen::Matrix3d& covariance = Eigen::Matrix3d::Zero(), const Found& before = {});

  /// Samples may come in any order as long as they are newer than the last scan taken. A step of the wheels that they
  /// cannot have made (see OdometryBuffer) is no motion: the estimate goes on at its velocity, less certain by
  /// options.motion.
  OdometryBuffer::Insertion addOdometry(const OdometrySample& sample);

  /// Readings may come in any order as long as they are newer than the last scan taken. A step of the odometry that
  /// they do not cover wholly is not measured by them.
  ImuBuffer::Insertion addImu(const ImuSample& sample) { return imu_.insert(sample); }

  /// The scan waits until odometry brackets its stamp, or until the wheels are silent and scans may carry on alone; for
  /// an IMU that is not silent it waits, too; with options.deskew for the end of its sweep, unless its time_increment
  /// cannot be: then it is used as it is; with several lasers until none of the others' can be older, or has taken too
  /// long to come. base_from_laser: the mount at the time of the scan. laser: below options.lasers, or
  /// std::out_of_range is thrown; each has references of its own.
  void addScan(LaserScan scan, const Eigen::Isometry3d& base_from_laser, std::size_t laser = 0);

  /// An absolute pose corrects the estimate in map, and never the one in odom. It waits for the scans that are older,
  /// but no longer than they may be late, and for odometry at its stamp; one whose time is past by no more than scans
  /// may be late is brought forward by the motion since. What is no pose is reported so.
  void addPose(const PoseUpdate& pose);

  /// What became of the absolute poses, by process() and by addPose(), since the last call.
  std::vector<PoseReport> takePoseReports();

  /// Takes the scans whose time has come, oldest first, and says what became of each.
  std::vector<ScanReport> process();

  /// The estimate carried on by the wheels to the newest odometry; empty before the first odometry.
  std::optional<Estimate> latest() const;

  /// The robot was there, whatever has been estimated. At a stamp before the last scan: brought forward by the motion
  /// since, if it is no longer ago than scans may be late. Of which no motion is at hand: there it is now; false then.
  /// Nothing is kept of what relates the estimate to its past: the next scan becomes the reference. What has been found
  /// of wheels, gyro and lasers stays; of the floor it is turned with the robot. Before the first odometry: where the
  /// estimate starts. Throws as the constructor does.
  bool setPose(const SE2& odom_from_base, const Eigen::Matrix3d& covariance, Stamp stamp);

  /// From the next scan on; the estimate and its references stay. Throws as checkChange() does.
  void setOptions(const PipelineOptions& options);

  Found found() const;

  /// The wheels are silent: the scans carry on alone, or wait, as options.scans_alone says.
  bool onScansAlone() const;

  /// Steps of the wheels that were not taken for motion.
  std::size_t odometryJumps() const { return odometry_.jumps(); }

  std::size_t waitingScans() const { return waiting_.size(); }
  const OdometryBuffer& odometry() const { return odometry_; }  ///< what is kept of it
  const PipelineOptions& options() const { return options_; }

 private:
  struct Laser {
    LaserConstants constants;
    SweepCheck sweeps;
    NoReturn no_return;
    std::optional<Stamp> taken;  // of the last scan of this estimate
  };
  struct CarriedOn {
    DeadReckoning estimate;
    Stamp stamp;
    Standstill standstill;
  };

  // The way of a scan (scan_odometry.cpp).
  void begin(const SE2& odom_from_base, const Eigen::Matrix3d& covariance, Stamp stamp);
  void turnFloor(double yaw);
  bool oldestHoldsBack() const;
  bool olderMayCome() const;
  ScanReport take(const WaitingScans::Entry& waiting);
  void useHeading(ScanReport& report);
  std::shared_ptr<const PreparedScan> prepared(const WaitingScans::Entry& waiting, std::string& rejection) const;
  void correctBy(ScanReport& report);
  LandmarkStates* landmarkFilter() const;  // null where landmarks are not used
  void claimLandmarks(ScanReport& report);
  void useLandmarks(ScanReport& report);
  Estimate estimate() const;

  // The motion between scans (scan_odometry_motion.cpp).
  ScanMotion motionDuring(const WaitingScans::Entry& waiting) const;
  EvenSweep evenSweep(const WaitingScans::Entry& waiting) const;
  void followAtADistance();
  void propagateTo(Stamp stamp);
  void leaveTrail();
  bool imuTells(Stamp stamp) const;
  Stamp settled() const;
  void carryOn();
  bool wheelsAreSilent() const;
  bool bridgeToOldestWaiting();
  void followWheels(Stamp since);
  void followScans(Stamp since, const DisplacementPrediction& at_since, const ScanReport& report);
  MotionGuess guess() const;
  OdometryIncrement increment(const OdometryBuffer::Step& step, Standstill& standstill) const;
  OdometryIncrement byWheels(const OdometryBuffer::Step& step) const;

  // Absolute poses (scan_odometry_poses.cpp).
  void takePoses(Stamp up_to);
  PoseReport take(const PoseUpdate& pose);
  std::optional<PoseMeasurement> broughtForward(const PoseUpdate& pose) const;
  std::optional<MapEstimate> inMap() const;

  PipelineOptions options_;
  std::vector<Laser> lasers_;
  OdometryBuffer odometry_;
  ImuBuffer imu_;
  TwistWindow twist_;
  WaitingScans waiting_;
  WaitingPoses waiting_poses_;
  std::vector<PoseReport> pose_reports_;
  Trail trail_;  // of filter_
  std::vector<ScanReport> given_up_;
  std::optional<Stamp> wheels_heard_;  // the newest stamp of odometry, used or not
  Stamp motion_known_{0};              // until here the motion has been measured

  SE2 start_;  // odom_from_base before there is a filter
  Eigen::Matrix3d start_covariance_;
  Found before_;                          // … and what is known by then
  std::unique_ptr<FusionMethod> filter_;  // at filter_stamp_; null before the first odometry
  MapFilter* map_ = nullptr;              // filter_, where absolute poses are used
  Stamp filter_stamp_{0};
  TwistWindow filter_twist_;  // up to filter_stamp_, of steps in the order of their stamps
  bool wheels_known_ = true;  // since the last scan
  double gyro_time_ = 0.0;    // [s] measured by a gyro, since then
  Standstill standstill_;     // up to filter_stamp_
  DisplacementUpdates displacements_;
  Landmarks landmarks_;
  std::optional<CarriedOn> carried_on_;  // the estimate, from filter_stamp_ on by the wheels …
  std::optional<CarriedOn> latest_;      // … and further, to the newest, where the IMU may yet tell more
};

}  // namespace sckf
