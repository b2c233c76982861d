// Landmarks of the filter with several clones.
#include "sckf_odometry/core/covariance.h"
#include "sckf_odometry/core/multi_clone_filter.h"
#include "sckf_odometry/core/world_error.h"

namespace sckf {

using Eigen::Matrix3d;
using world_error::additive;
using world_error::inverseOfAdditive;

Matrix3d MultiCloneFilter::landmarkCovariance(std::size_t number) const {
  const Matrix3d T = additive(landmarks_[number].pose);
  return symmetric(T * errors_.covariance(landmarks_[number].error) * T.transpose());
}

void MultiCloneFilter::addLandmark(const Sighting& sighting) {
  Matrix3d G;
  const SE2 pose = compose(pose_, sighting.base_from_landmark, nullptr, &G);
  const Matrix3d W = inverseOfAdditive(pose) * G;
  const Part error = errors_.addCloneOf(pose_error_);
  errors_.disturb(error, symmetric(W * sighting.covariance * W.transpose()));
  landmarks_.push_back({pose, error});
}

void MultiCloneFilter::forgetLandmark(std::size_t number) {
  errors_.remove(landmarks_[number].error);
  landmarks_.erase(landmarks_.begin() + static_cast<std::ptrdiff_t>(number));
}

/// By the landmark's ξ, and by −ξ of the pose: it sees nothing but their difference.
ErrorState::Measurement MultiCloneFilter::measurement(std::size_t landmark, const Sighting& sighting) const {
  const auto& [pose, error_of_landmark] = landmarks_[landmark];
  Matrix3d J;
  const SE2 expected = between(pose_, pose, nullptr, &J);
  const Matrix3d H = J * additive(pose);
  return {error(sighting.base_from_landmark, expected),
          {{error_of_landmark, H}, {pose_error_, -H}},
          {},
          sighting.covariance};
}

Innovation MultiCloneFilter::innovation(std::size_t landmark, const Sighting& sighting) const {
  const Measurement m = measurement(landmark, sighting);
  Innovation r;
  r.residual = m.residual;
  r.covariance = errors_.correlate(m).innovation;
  return r;
}

void MultiCloneFilter::update(std::size_t landmark, const Sighting& sighting) {
  correct(measurement(landmark, sighting), allStates());
}

}  // namespace sckf
