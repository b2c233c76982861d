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
#include "sckf_odometry/matching/scan_matcher.h"
#include "sckf_odometry/pipeline/imu_buffer.h"
#include "sckf_odometry/pipeline/landmarks.h"
#include "sckf_odometry/pipeline/laser_constants.h"
#include "sckf_odometry/pipeline/odometry_buffer.h"
#include "sckf_odometry/pipeline/other_sensors.h"
#include "sckf_odometry/pipeline/pose_updates.h"
#include "sckf_odometry/pipeline/reference_policy.h"
#include "sckf_odometry/pipeline/reference_scans.h"
#include "sckf_odometry/pipeline/scan_report.h"
#include "sckf_odometry/pipeline/twist_window.h"
#include "sckf_odometry/pipeline/waiting_scans.h"

namespace sckf {

/// What happens to a displacement that contradicts the wheels.
struct GateOptions {
  double probability = 0.999;         ///< χ² gate: an innovation less likely than 1 − this contradicts
  bool trust_scans_on_slip = true;    ///< where the scans match well, put the contradiction down to the wheels
  double slip_std_translation = 0.5;  ///< [m] what the wheels may have been wrong by in such an interval …
  double slip_std_yaw = 0.5;          ///< [rad] … and in yaw
  double slip_max_misfit = 1.3;       ///< scans match well if Match::misfit is at most this …
  double slip_min_overlap = 0.6;  ///< … and where they see two directions only, this share of the points has a partner
  double doubtful_min_agreement = 0.85;  ///< agreement that a reference needs which could not be placed itself, and an
                                         ///< older one that is found far from the prediction
};

struct PipelineOptions {
  std::string method = "sckf_multi";  ///< one of fusionMethodNames()
  OdometryNoise odometry_noise;
  CalibrationOptions calibration;
  ImuOptions imu;
  StandstillOptions standstill;
  PoseUpdateOptions pose_updates;
  bool prefer_twist_covariance = false;  ///< use the twist covariance of the odometry message where it is sensible
  ScanOptions scan;
  double range_offset_std = 0.015;   ///< [m] how wrong all ranges of a laser may be together: estimated; 0: not at all
  double sweep_duration_std = 0.01;  ///< [s] how long a laser may take for a scan: estimated; 0: motion meanwhile stays
  bool deskew = false;  ///< undo the motion while a scan is taken; it waits for odometry at its last beam then
  MatcherOptions matcher;
  ReferenceOptions reference;
  GateOptions gate;
  LandmarkOptions landmarks;
  MotionLimits motion;
  double twist_window = 0.2;      ///< [s] the twist is the mean over this time: stamps of odometry come in bursts
  double max_scan_delay = 5.0;    ///< [s] a scan that is older than the newest odometry by more is not used
  int max_waiting_scans = 50;     ///< scans that wait for odometry; beyond, the one that has waited longest is given up
  double odometry_timeout = 1.0;  ///< [s] wheels whose newest odometry is older than scans by more are silent
  bool scans_alone = false;       ///< silent wheels: the scans carry on alone; false: the estimate waits
  std::size_t lasers = 1;         ///< how many there are; more than one by sckf_multi only
  double scan_patience = 0.25;    ///< [s] of several lasers: a scan waits so long for older ones of the others
};

class ScanOdometry {
 public:
  /// The estimate starts at a pose, with a covariance: symmetric, positive semi-definite. Throws std::invalid_argument
  /// with name, value and what is expected if there is no method, or no odometry model, of that name, if the method
  /// lacks what the options ask for, or if pose or covariance are none.
  explicit ScanOdometry(const PipelineOptions& options, const SE2& odom_from_base = SE2(),
                        const Eigen::Matrix3d& covariance = Eigen::Matrix3d::Zero());

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

  /// The robot was there, whatever has been estimated; at the newest odometry, if none is at hand for the stamp.
  /// Nothing is kept of what relates the estimate to its past: the next scan becomes the reference. Before the first
  /// odometry: where the estimate starts. Throws as the constructor does.
  void setPose(const SE2& odom_from_base, const Eigen::Matrix3d& covariance, Stamp stamp);

  /// From the next scan on; the estimate and its reference stay. Throws std::invalid_argument if the method differs, or
  /// lacks what the options ask for, or there is no odometry model of that name.
  void setOptions(const PipelineOptions& options);

  /// The wheels are silent: the scans carry on alone, or wait, as options.scans_alone says.
  bool onScansAlone() const;

  /// Steps of the wheels that were not taken for motion.
  std::size_t odometryJumps() const { return odometry_.jumps(); }

  std::size_t waitingScans() const { return waiting_.size(); }
  const OdometryBuffer& odometry() const { return odometry_; }  ///< what is kept of it
  const PipelineOptions& options() const { return options_; }

 private:
  void begin(const SE2& odom_from_base, const Eigen::Matrix3d& covariance, Stamp stamp);
  ScanReport take(const WaitingScans::Entry& waiting);
  std::shared_ptr<const PreparedScan> prepared(const WaitingScans::Entry& waiting, std::string& rejection) const;
  void compareWithReference(std::size_t clone, ScanReport& report);
  bool fuse(ScanReport& report);
  void allowForSlip();
  void admitFailure(const ScanReport& report);
  void compareWithOlderReferences(ScanReport& report);
  Match matchWithOlder(const PreparedScan& reference, const PreparedScan& scan,
                       const DisplacementPrediction& prediction, bool placed) const;
  void allowForCommonErrors(const ScanReport& report);
  LandmarkStates* landmarkFilter() const;  ///< null where landmarks are not used
  void claimLandmarks(ScanReport& report);
  void useLandmarks(ScanReport& report);
  double gate(const Displacement& displacement) const;  ///< a larger innovation, normalised and squared, contradicts
  bool looksLikeSlip(const ScanReport& report) const;
  bool outweighsWheels(const Match& match) const;
  bool matchesWell(const Match& match) const;
  bool isPlaced(const Match& match) const;
  ScanMotion motionDuring(const WaitingScans::Entry& waiting) const;
  EvenSweep evenSweep(const WaitingScans::Entry& waiting) const;
  void propagateTo(Stamp stamp);
  void leaveTrail();
  void useHeading(ScanReport& report);
  void takePoses(Stamp up_to);
  PoseReport take(const PoseUpdate& pose);
  std::optional<PoseMeasurement> broughtForward(const PoseUpdate& pose) const;
  std::optional<MapEstimate> inMap() const;
  void carryOn();
  bool imuTells(Stamp stamp) const;
  Stamp settled() const;
  void followAtADistance();

  bool wheelsAreSilent() const;
  bool bridgeToOldestWaiting();
  bool olderMayCome() const;
  void followWheels(Stamp since);
  void followScans(Stamp since, const DisplacementPrediction& at_since, const ScanReport& report);
  MotionGuess guess() const;

  OdometryIncrement byWheels(const OdometryBuffer::Step& step) const;
  OdometryIncrement increment(const OdometryBuffer::Step& step, Standstill& standstill) const;
  Estimate estimate() const;

  PipelineOptions options_;
  ScanMatcher matcher_;
  struct Laser {
    ReferencePolicy policy;
    LaserConstants constants;
    SweepCheck sweeps;
    std::optional<Stamp> taken;  ///< of the last scan of this estimate
    int failures = 0;            ///< so many scans, the last among them, were placed by no reference
  };
  std::vector<Laser> lasers_;
  OdometryBuffer odometry_;
  ImuBuffer imu_;
  TwistWindow twist_;
  WaitingScans waiting_;
  WaitingPoses waiting_poses_;
  std::vector<PoseReport> pose_reports_;
  Trail trail_;  // of filter_, where absolute poses are used
  std::vector<ScanReport> given_up_;
  std::optional<Stamp> wheels_heard_;  // the newest stamp of odometry, used or not
  Stamp motion_known_{0};              // until here the motion has been measured

  SE2 start_;  // odom_from_base before there is a filter
  Eigen::Matrix3d start_covariance_;
  std::unique_ptr<FusionMethod> filter_;  // at filter_stamp_; null before the first odometry
  MapFilter* map_ = nullptr;              // filter_, where absolute poses are used
  Stamp filter_stamp_{0};
  TwistWindow filter_twist_;  // up to filter_stamp_, of steps in the order of their stamps
  bool wheels_known_ = true;  // since the last scan
  double gyro_time_ = 0.0;    // [s] measured by a gyro, since then
  Standstill standstill_;     // up to filter_stamp_
  ReferenceScans references_;
  Landmarks landmarks_;
  std::optional<DeadReckoning> carried_on_;  // the estimate, from filter_stamp_ on by the wheels to carried_on_stamp_ …
  Stamp carried_on_stamp_{0};
  Standstill carried_on_standstill_;
  std::optional<DeadReckoning> latest_;  // … and further, to latest_stamp_, which the IMU may yet tell more of
  Stamp latest_stamp_{0};
};

}  // namespace sckf
