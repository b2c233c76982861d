// How the robot moves while a scan is taken.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sckf_odometry/core/se2.h"

namespace sckf {

/// The motion of base_link from a scan's stamp on, put together from parts. Without any the robot is at rest.
class ScanMotion {
 public:
  /// The motion over the next duration [s], above 0; in base_link before the part. Within it the robot is taken to move
  /// evenly in x, y and yaw.
  void add(const SE2& before_from_after, double duration);

  bool atRest() const { return parts_.empty(); }
  double duration() const { return atRest() ? 0.0 : parts_.back().end; }  ///< [s], of all parts

  /// base_link t [s] after the stamp, seen from base_link at the stamp: stamp_from_base. Before the first part and
  /// after the last one the robot is where that begins, or ends.
  SE2 at(double t) const;

 private:
  struct Part {
    double begin;  // [s] after the stamp
    double end;
    SE2 stamp_from_begin;
    SE2 begin_from_end;
  };
  std::vector<Part> parts_;
};

/// A scan of which nobody tells when its beams were measured: one after the other, it is taken, evenly about the stamp,
/// by a robot that moves evenly.
struct EvenSweep {
  Eigen::Vector3d twist = Eigen::Vector3d::Zero();  ///< of base_link: (vx, vy, yaw rate) [m/s, m/s, rad/s]
  double duration = 0.0;                            ///< from the first beam to the last [s]; below 0: the last is first

  /// base_link when a beam was measured, seen from base_link at the stamp. share: of the beam, -1/2 the first, 1/2 the
  /// last.
  SE2 at(double share) const { return SE2(share * duration * twist); }
};

}  // namespace sckf
