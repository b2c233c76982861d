// Landmarks in the state of a filter (VI-5), and what a scan tells of one.
#pragma once

#include "sckf_odometry/core/fusion_method.h"

namespace sckf {

/// A landmark as one scan sees it: the pose of a frame that is fixed to it, in base_link, with the covariance of its
/// additive error, which is independent of everything else: of ranges that nothing else uses. Of a line the frame may
/// be anywhere along its x axis: its offset and its yaw are seen, and where along it the frame is has no error.
struct Sighting {
  SE2 base_from_landmark;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  bool is_line = false;

  /// The directions of x, y, yaw in base_link that are seen, d × 3: all three; of a line across it, and yaw.
  Displacement::MatrixD3 seen() const;
};

/// An estimator that has landmarks, each a pose, beside the robot's. They are numbered in the order in which they were
/// added.
class LandmarkStates : public FusionMethod {
 public:
  using FusionMethod::innovation;
  using FusionMethod::update;

  virtual std::size_t landmarks() const = 0;
  virtual SE2 landmark(std::size_t number) const = 0;                        ///< odom_from_landmark
  virtual Eigen::Matrix3d landmarkCovariance(std::size_t number) const = 0;  ///< of its additive error
  virtual void addLandmark(const Sighting& sighting) = 0;
  virtual void forgetLandmark(std::size_t number) = 0;  ///< those after it move up

  /// What is seen less what is expected in the directions that are seen, d, with its covariance. Of a line where it is
  /// sighted: there and not at its frame's origin it is compared.
  virtual Innovation innovation(std::size_t landmark, const Sighting& sighting) const = 0;
  virtual void update(std::size_t landmark, const Sighting& sighting) = 0;
};

}  // namespace sckf
