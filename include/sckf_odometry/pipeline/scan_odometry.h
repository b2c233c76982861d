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
#include "sckf_odometry/pipeline/odometry_buffer.h"
#include "sckf_odometry/pipeline/reference_policy.h"
#include "sckf_odometry/pipeline/twist_window.h"
#include "sckf_odometry/pipeline/waiting_scans.h"

namespace sckf {

/// What happens to a displacement that contradicts the wheels.
struct GateOptions {
  double probability = 0.999;         ///< χ² gate: an innovation less likely than 1 − this contradicts
  bool trust_scans_on_slip = true;    ///< where the scans match well, put the contradiction down to the wheels
  double slip_std_translation = 0.3;  ///< [m] what the wheels may have been wrong by in such an interval …
  double slip_std_yaw = 0.3;          ///< [rad] … and in yaw
  double slip_min_overlap = 0.4;      ///< scans match well if at least this share of the points has a partner …
  double slip_max_residual = 2.0;     ///< … and the weighted residuals are at most this
};

struct PipelineOptions {
  std::string method = "sckf";  ///< one of fusionMethodNames()
  OdometryNoise odometry_noise;
  bool prefer_twist_covariance = false;  ///< use the twist covariance of the odometry message where it is sensible
  ScanOptions scan;
  MatcherOptions matcher;
  ReferenceOptions reference;
  GateOptions gate;
  MotionLimits motion;
  double twist_window = 0.2;      ///< [s] the twist is the mean over this time: stamps of odometry come in bursts
  double max_scan_delay = 5.0;    ///< [s] a scan that is older than the newest odometry by more is not used
  int max_waiting_scans = 50;     ///< scans that wait for odometry; beyond, the one that has waited longest is given up
  double odometry_timeout = 1.0;  ///< [s] wheels whose newest odometry is older than scans by more are silent
  bool scans_alone = false;       ///< silent wheels: the scans carry on alone; false: the estimate waits
};

/// Where base_link is in odom, with the covariance of the additive error in x, y, yaw.
struct Estimate {
  Stamp stamp{0};
  SE2 odom_from_base;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  Twist twist;
};

/// What became of a scan.
enum class ScanOutcome {
  kReference,   ///< the first scan: it became the reference, there is nothing to compare it with
  kUpdated,     ///< its displacement corrected the estimate
  kSlip,        ///< its displacement contradicts the wheels, and corrected the estimate: the wheels slipped
  kGated,       ///< its displacement contradicts the prediction beyond the gate: the wheels carry on
  kNoMatch,     ///< there is no displacement: the wheels carry on
  kUnusable,    ///< the scan itself is bad: the wheels carry on
  kOutOfOrder,  ///< not newer than the estimate: not used
  kNoOdometry,  ///< no odometry at its stamp: not used
};
std::string toString(ScanOutcome outcome);

struct ScanReport {
  Stamp stamp{0};
  ScanOutcome outcome = ScanOutcome::kReference;
  std::string reason;                        ///< in words, where the scan did not correct the estimate
  std::optional<Estimate> estimate;          ///< at the scan's stamp; empty if out of order or without odometry
  Match match;                               ///< of a scan that was compared with a reference
  DisplacementPrediction prediction;         ///< what the filter expected
  std::optional<Innovation> innovation;      ///< where there is a displacement
  double nis_bound = 0.0;                    ///< what contradicts the prediction has a larger nis()
  Stamp reference_stamp{0};                  ///< of the scan that it was compared with
  bool new_reference = false;                ///< it became the reference
  bool wheels_known = true;                  ///< false: wheels did not tell all of the motion since the scan before
  double match_time = 0.0;                   ///< [s] spent on the comparison with the reference …
  double total_time = 0.0;                   ///< [s] … and on the scan on the whole
  std::shared_ptr<const PreparedScan> scan;  ///< its points in base_link; null if it was not used
};

class ScanOdometry {
 public:
  /// The estimate starts at a pose, with a covariance: symmetric, positive semi-definite. Throws std::invalid_argument
  /// with name, value and what is expected if there is no method of that name, or pose or covariance are none.
  explicit ScanOdometry(const PipelineOptions& options, const SE2& odom_from_base = SE2(),
                        const Eigen::Matrix3d& covariance = Eigen::Matrix3d::Zero());

  /// Samples may come in any order as long as they are newer than the last scan taken. A step of the wheels that they
  /// cannot have made (see OdometryBuffer) is no motion: the estimate goes on at its velocity, less certain by
  /// options.motion.
  OdometryBuffer::Insertion addOdometry(const OdometrySample& sample);

  /// The scan waits until odometry brackets its stamp, or until the wheels are silent and scans may carry on alone.
  /// base_from_laser: the mount at the time of the scan.
  void addScan(LaserScan scan, const Eigen::Isometry3d& base_from_laser);

  /// Takes the scans whose time has come, oldest first, and says what became of each.
  std::vector<ScanReport> process();

  /// The estimate carried on by the wheels to the newest odometry; empty before the first odometry.
  std::optional<Estimate> latest() const;

  /// The robot was there, whatever has been estimated; at the newest odometry, if none is at hand for the stamp.
  /// Nothing is kept of what relates the estimate to its past: the next scan becomes the reference. Before the first
  /// odometry: where the estimate starts. Throws as the constructor does.
  void setPose(const SE2& odom_from_base, const Eigen::Matrix3d& covariance, Stamp stamp);

  /// From the next scan on; the estimate and its reference stay. Throws std::invalid_argument if the method differs.
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
  void compareWithReference(ScanReport& report);
  bool fuse(ScanReport& report);
  bool looksLikeSlip(const Match& match) const;
  void propagateTo(Stamp stamp);
  void carryOn();

  bool wheelsAreSilent() const;
  bool bridgeTo(Stamp stamp);
  void followWheels(Stamp since);
  void followScans(Stamp since, const DisplacementPrediction& at_since, const ScanReport& report);
  MotionGuess guess() const;

  OdometryIncrement increment(const OdometryBuffer::Step& step) const;
  Estimate estimate() const;

  PipelineOptions options_;
  ScanMatcher matcher_;
  ReferencePolicy reference_policy_;
  OdometryBuffer odometry_;
  TwistWindow twist_;
  WaitingScans waiting_;
  std::vector<ScanReport> given_up_;
  std::optional<Stamp> wheels_heard_;  // the newest stamp of odometry, used or not
  Stamp motion_known_{0};              // until here the motion has been measured

  SE2 start_;  // odom_from_base before there is a filter
  Eigen::Matrix3d start_covariance_;
  std::unique_ptr<FusionMethod> filter_;  // at filter_stamp_; null before the first odometry
  Stamp filter_stamp_{0};
  bool wheels_known_ = true;  // since the last scan
  std::shared_ptr<const PreparedScan> reference_;
  std::optional<DeadReckoning> carried_on_;  // the estimate, from filter_stamp_ on by the wheels to carried_on_stamp_
  Stamp carried_on_stamp_{0};
};

}  // namespace sckf
