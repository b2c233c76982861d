// The whole way of a scan: odometry and scans in, estimates out. No middleware's type in it; the nodelet and the
// offline replay drive this very class.
#pragma once

#include <Eigen/Geometry>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/matching/scan_matcher.h"
#include "sckf_odometry/pipeline/odometry_buffer.h"

namespace sckf {

struct PipelineOptions {
  std::string method = "sckf";  ///< one of fusionMethodNames()
  OdometryNoise odometry_noise;
  bool prefer_twist_covariance = false;  ///< use the twist covariance of the odometry message where it is sensible
  ScanOptions scan;
  MatcherOptions matcher;
  double kf_dist_linear = 1.0;     ///< [m] a new reference scan after this way from the last
  double kf_dist_angular = 0.7;    ///< [rad] … or this rotation
  double kf_min_overlap = 0.6;      ///< … or when a smaller share of the points overlaps
  double gate_probability = 0.999;  ///< χ² gate: an innovation less likely than 1 − this is refused
  bool slip = true;
  std::size_t max_waiting_scans = 50;  ///< scans that wait for odometry; beyond, the oldest is dropped
};

/// Where base_link is in odom, with the covariance of the additive error in x, y, yaw.
struct Estimate {
  Stamp stamp{0};
  SE2 odom_from_base;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  Eigen::Vector3d twist = Eigen::Vector3d::Zero();  ///< vx, vy [m/s], yaw rate [rad/s] in base_link
  Eigen::Matrix3d twist_covariance = Eigen::Matrix3d::Zero();
};

/// What became of a scan.
enum class ScanOutcome {
  kReference,   ///< the first scan, or the first after a gap: it became the reference, nothing to compare it with
  kUpdated,     ///< its displacement corrected the estimate
  kNoMatch,     ///< the matcher found no displacement: the wheels carry on
  kGated,       ///< the displacement contradicts the prediction beyond the gate: the wheels carry on
  kSlip,        ///< the displacement contradicts the wheels, and the scans are trusted for this interval
  kNoOdometry,  ///< no odometry at its stamp: not used
  kOutOfOrder,  ///< not newer than the last scan: not used
  kUnusable,    ///< the scan itself is bad: not used
};
std::string toString(ScanOutcome outcome);

struct ScanReport {
  ScanOutcome outcome = ScanOutcome::kReference;
  std::string reason;                    ///< in words, where the scan was not used
  Estimate estimate;                     ///< at the scan's stamp
  Match match;                           ///< of a scan that was compared with a reference
  DisplacementPrediction prediction;     ///< what the filter expected
  std::optional<Innovation> innovation;  ///< of a match
  bool new_reference = false;
  Stamp reference_stamp{0};                  ///< of the scan that it was compared with
  std::shared_ptr<const PreparedScan> scan;  ///< the scan's points in base_link
};

class ScanOdometry {
 public:
  /// Throws std::invalid_argument naming the option, its value and what is allowed.
  explicit ScanOdometry(const PipelineOptions& options);
  ~ScanOdometry();

  OdometryBuffer::Insertion addOdometry(const OdometrySample& sample);

  /// The scan waits until odometry brackets its stamp. base_from_laser: the mount at the time of the scan.
  void addScan(const LaserScan& scan, const Eigen::Isometry3d& base_from_laser);

  /// Takes the scans whose time has come, oldest first, and says what became of each.
  std::vector<ScanReport> process();

  /// The estimate carried on by the wheels to the newest odometry; empty before the first odometry.
  std::optional<Estimate> latest() const;

 private:
  struct WaitingScan {
    LaserScan scan;
    Eigen::Isometry3d base_from_laser;
  };
  ScanReport processScan(const WaitingScan& waiting);

  PipelineOptions options_;
  ScanMatcher matcher_;
  OdometryBuffer odometry_;
  std::deque<WaitingScan> waiting_;
  std::unique_ptr<FusionMethod> filter_;
  Stamp filter_stamp_{0};
  SE2 last_;
  std::shared_ptr<const PreparedScan> reference_;
};

}  // namespace sckf
