// What comes out of the pipeline: estimates, and what became of each scan.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sckf_odometry/matching/scan_matcher.h"
#include "sckf_odometry/pipeline/laser_constants.h"
#include "sckf_odometry/pipeline/no_return.h"
#include "sckf_odometry/pipeline/pose_updates.h"
#include "sckf_odometry/pipeline/sweep.h"
#include "sckf_odometry/pipeline/twist_window.h"

namespace sckf {

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
  kUpdated,     ///< its displacement corrected the estimate; where displacements are not used: its landmarks did
  kSlip,        ///< its displacement contradicts the wheels, and corrected the estimate: the wheels slipped
  kGated,       ///< its displacement contradicts the prediction beyond the gate: the wheels carry on
  kNoMatch,     ///< there is no displacement: the wheels carry on
  kUnusable,    ///< the scan itself is bad: the wheels carry on
  kOutOfOrder,  ///< not newer than the estimate: not used
  kNoOdometry,  ///< no odometry at its stamp: not used
};
std::string toString(ScanOutcome outcome);

/// It corrected the estimate.
bool wasUsed(ScanOutcome outcome);

/// What became of a heading.
enum class HeadingUse {
  kNone,         ///< there is none, or its readings have been used for another scan
  kUsed,         ///< it corrected the estimate, or, the first one, told how the IMU's world is turned
  kContradicts,  ///< it contradicts the estimate beyond the gate
};
std::string toString(HeadingUse use);

/// A landmark of the state.
struct LandmarkView {
  SE2 odom_from_landmark;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of the error of x, y, yaw
  bool used = false;                                     ///< the scan has seen it
  bool is_line = false;                                  ///< or a corner
  double from = 0.0;                                     ///< of a line: along its x axis it is known from here [m] …
  double to = 0.0;                                       ///< … to here
};

struct ScanReport {
  Stamp stamp{0};
  std::size_t laser = 0;
  ScanOutcome outcome = ScanOutcome::kReference;
  std::string reason;                        ///< in words, where the scan did not correct the estimate
  std::optional<Estimate> estimate;          ///< at the scan's stamp; empty if out of order or without odometry
  Match match;                               ///< of a scan that was compared with a reference
  DisplacementPrediction prediction;         ///< what the filter expected
  std::optional<Innovation> innovation;      ///< where there is a displacement
  double nis_bound = 0.0;                    ///< what contradicts the prediction has a larger nis()
  Stamp reference_stamp{0};                  ///< of the scan that it was compared with
  bool new_reference = false;                ///< it became the reference
  int older_references = 0;                  ///< so many more references corrected the estimate
  bool wheels_known = true;                  ///< false: wheels did not tell all of the motion since the scan before
  WheelCalibration calibration;              ///< then; its covariance is zero if it is not estimated
  GyroBias gyro_bias;                        ///< then; its variance is zero if it is not estimated
  LaserConstants laser_constants;            ///< of its laser, after the scan; variance zero: not estimated
  double gyro_time = 0.0;                    ///< [s] since the estimate before, that the gyro has measured
  HeadingUse heading = HeadingUse::kNone;    ///< of the IMU, at the scan's stamp
  bool stands = false;                       ///< the wheels have told of no motion for some time
  std::optional<MapEstimate> in_map;         ///< then; empty before the first absolute pose
  Deskewing deskewing = Deskewing::kOff;     ///< what became of the motion during the scan
  std::string deskewing_problem;             ///< in words, where it could not be undone
  NoReturn no_return;                        ///< of its laser, found by then
  int landmarks_used = 0;                    ///< so many landmarks corrected the estimate …
  std::vector<LandmarkView> landmarks;       ///< … of these, after the scan
  double match_time = 0.0;                   ///< [s] spent on the comparison with the reference …
  double total_time = 0.0;                   ///< [s] … and on the scan on the whole
  std::shared_ptr<const PreparedScan> scan;  ///< its points in base_link; null if it was not used
};

/// Of a scan that is not used.
ScanReport notUsed(Stamp stamp, std::size_t laser, ScanOutcome outcome, const std::string& reason);

}  // namespace sckf
