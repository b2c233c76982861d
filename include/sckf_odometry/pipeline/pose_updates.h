// Absolute poses on their way to the filter, and what became of them.
#pragma once

#include <deque>
#include <optional>
#include <string>

#include "sckf_odometry/matching/laser_scan.h"
#include "sckf_odometry/pipeline/map_filter.h"

namespace sckf {

/// Where the robot was in map.
struct PoseUpdate {
  Stamp stamp{0};
  PoseMeasurement map_from_base;
};

/// Where base_link is in map, and so odom.
struct MapEstimate {
  Stamp stamp{0};
  SE2 map_from_base;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of the additive error of map_from_base in x, y, yaw
  SE2 map_from_odom;
};

/// What became of an absolute pose.
struct PoseReport {
  Stamp stamp{0};
  PoseOutcome outcome = PoseOutcome::kUsed;
  std::string reason;  ///< in words, where it was not used
  double nis = 0.0;    ///< normalised innovation squared
  double nis_bound = 0.0;
  std::optional<MapEstimate> in_map;  ///< then
};

/// Of a pose that is not used.
PoseReport notUsed(Stamp stamp, PoseOutcome outcome, const std::string& reason);

/// Absolute poses that wait for their time, the oldest first.
class WaitingPoses {
 public:
  /// The one that has waited longest is given up if there are too many: then it is returned.
  std::optional<PoseUpdate> add(const PoseUpdate& pose);
  /// The oldest that is not newer than an instant.
  std::optional<PoseUpdate> takeUpTo(Stamp stamp);
  void clear() { poses_.clear(); }
  std::size_t size() const { return poses_.size(); }

 private:
  std::deque<PoseUpdate> poses_;
};

/// Where the estimate has been lately, so that a pose that comes late can be brought forward by the motion since.
class Trail {
 public:
  /// duration: [s] that is kept.
  void add(Stamp stamp, const SE2& odom_from_base, double duration);
  /// Interpolated; empty where nothing is kept.
  std::optional<SE2> at(Stamp stamp) const;
  /// As if all had been elsewhere: by a displacement of odom.
  void move(const SE2& by);

 private:
  struct Entry {
    Stamp stamp;
    SE2 odom_from_base;
  };
  std::deque<Entry> poses_;
};

}  // namespace sckf
