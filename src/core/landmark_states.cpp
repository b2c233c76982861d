// Landmarks of the filter with several clones.
#include <cmath>

#include "sckf_odometry/core/covariance.h"
#include "sckf_odometry/core/multi_clone_filter.h"
#include "sckf_odometry/core/world_error.h"

namespace sckf {

using Eigen::Matrix3d;
using world_error::additive;
using world_error::inverseOfAdditive;

Displacement::MatrixD3 Sighting::seen() const {
  if (!is_line) return Matrix3d::Identity();
  Displacement::MatrixD3 across_and_yaw(2, 3);
  across_and_yaw << -std::sin(base_from_landmark.yaw), std::cos(base_from_landmark.yaw), 0.0, 0.0, 0.0, 1.0;
  return across_and_yaw;
}

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

/// By the landmark's ξ, and by −ξ of the pose: it sees nothing but their difference. What is across a line the line as
/// it is known tells: a direction that followed the noise of each sighting would see a little along it, too.
ErrorState::Measurement MultiCloneFilter::measurement(std::size_t landmark, const Sighting& sighting) const {
  const auto& [pose, error_of_landmark] = landmarks_[landmark];
  SE2 met = pose;
  if (sighting.is_line) {
    const SE2 sighted = compose(pose_, sighting.base_from_landmark);
    met = compose(pose, SE2(between(pose, sighted).x, 0.0, 0.0));
  }
  Matrix3d J;
  const SE2 expected = between(pose_, met, nullptr, &J);
  const Displacement::MatrixD3 S = Sighting{expected, Matrix3d::Zero(), sighting.is_line}.seen();
  const Displacement::MatrixD3 H = S * J * additive(met);
  return {S * error(sighting.base_from_landmark, expected),
          {{error_of_landmark, H}, {pose_error_, -H}},
          {},
          S * sighting.covariance * S.transpose()};
}

Innovation MultiCloneFilter::innovation(std::size_t landmark, const Sighting& sighting) const {
  const Measurement m = measurement(landmark, sighting);
  Innovation r;
  r.residual = m.residual;
  r.covariance = errors_.correlate(m).innovation;
  return r;
}

void MultiCloneFilter::update(std::size_t landmark, const Sighting& sighting) {
  const Measurement m = measurement(landmark, sighting);
  places_told_ = true;
  correct(m, errors_.correlate(m), allStates(), clones_.back().error);
}

}  // namespace sckf
