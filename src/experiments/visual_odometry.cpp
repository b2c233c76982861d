#include "sckf_odometry/experiments/visual_odometry.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "sckf_odometry/experiments/random_draws.h"

namespace sckf {

namespace {

using Covariance = DisplacementCovariance<6>;

/// Features at random around the way, which leads along z; sorted by how far along they are.
std::vector<Eigen::Vector3d> scatterFeatures(const VisualOdometryOptions& options, RandomDraws& random) {
  const double half_width = options.camera.far * options.camera.half_width / options.camera.focal_length;
  const double half_height = options.camera.far * options.camera.half_height / options.camera.focal_length;
  const double length = options.way + options.camera.far;
  const auto count = std::lround(options.features * 4.0 * half_width * half_height * length);
  std::vector<Eigen::Vector3d> features;
  for (long i = 0; i < count; ++i) {
    const double along = length * (static_cast<double>(i) + random.uniform(0.0, 1.0)) / static_cast<double>(count);
    features.emplace_back(random.uniform(-half_width, half_width), random.uniform(-half_height, half_height), along);
  }
  return features;
}

/// One view, and the true errors of its pixels, in the order of the columns of the Jacobians.
StereoView takeView(const VisualOdometryOptions& options, const std::vector<Eigen::Vector3d>& features, double along,
                    RandomDraws& random) {
  const double density = static_cast<double>(features.size()) / (options.way + options.camera.far);
  const auto first = static_cast<std::size_t>(std::max(0.0, (along + options.camera.near) * density - 1.0));
  StereoView view;
  for (std::size_t i = first; i < features.size(); ++i) {
    const Eigen::Vector3d point = features[i] - along * Eigen::Vector3d::UnitZ();
    if (point.z() > options.camera.far) break;
    if (!options.camera.sees(point)) continue;
    view.features.push_back(static_cast<int>(i));
    view.pixels.emplace_back(options.camera.project(point) + options.pixel_std * random.gaussian(3));
  }
  return view;
}

Eigen::VectorXd pixelVariances(const VisualOdometryOptions& options, const StereoView& view) {
  return Eigen::VectorXd::Constant(3 * static_cast<Eigen::Index>(view.features.size()), std::pow(options.pixel_std, 2));
}

void add(const Matrix6d& P, int runs, VisualOdometryPoint::Traces& traces) {
  traces.position += P.topLeftCorner<3, 3>().trace() / runs;
  traces.attitude += P.bottomRightCorner<3, 3>().trace() / runs;
}

/// Returns the error at the end.
Vector6d run(const VisualOdometryOptions& options, int steps, RandomDraws& random, VisualOdometryPoint& sums) {
  const std::vector<Eigen::Vector3d> features = scatterFeatures(options, random);
  const SE3 moved{{0.0, 0.0, sums.spacing}, Eigen::Matrix3d::Identity()};
  SE3 pose;
  Covariance with(Matrix6d::Zero(), Covariance::Correlations::kKept);
  Covariance without(Matrix6d::Zero(), Covariance::Correlations::kIgnored);
  StereoView reference = takeView(options, features, 0.0, random);
  for (Covariance* covariance : {&with, &without}) {
    covariance->clone(Matrix6d::Identity(), Matrix6d::Identity(), pixelVariances(options, reference));
  }
  for (int step = 1; step <= steps; ++step) {
    const StereoView current = takeView(options, features, step * sums.spacing, random);
    const StereoDisplacement z = matchViews(options.camera, reference, current, options.pixel_std, moved);
    if (z.shared < 3) throw std::runtime_error("two views share fewer than three features: try more, or nearer views");
    Matrix6d Phi;
    Matrix6d Gamma;
    pose = compose(pose, z.reference_from_current, &Phi, &Gamma);
    for (Covariance* covariance : {&with, &without}) {  // (33)
      covariance->replace(z.measurement, Matrix6d::Identity());
      covariance->clone(Phi, Gamma, z.measurement.variance_current);
    }
    sums.features += static_cast<double>(z.shared) / (steps * options.runs);
    reference = current;
  }
  const SE3 truth{{0.0, 0.0, options.way}, Eigen::Matrix3d::Identity()};
  add(with.covariance(Matrix6d::Identity(), Matrix6d::Zero()), options.runs, sums.with_correlations);
  add(without.covariance(Matrix6d::Identity(), Matrix6d::Zero()), options.runs, sums.without);
  return error(truth, pose);
}

void summarise(const std::vector<Vector6d>& errors, VisualOdometryPoint& point) {
  const auto n = static_cast<double>(errors.size());
  Vector6d mean = Vector6d::Zero();
  for (const Vector6d& e : errors) mean += e / n;
  Matrix6d scatter = Matrix6d::Zero();
  for (const Vector6d& e : errors) scatter += (e - mean) * (e - mean).transpose() / std::max(1.0, n - 1.0);
  add(scatter, 1, point.scatter);
  point.mean_error = mean.head<3>().norm();
}

}  // namespace

std::vector<VisualOdometryPoint> simulateVisualOdometry(const VisualOdometryOptions& options,
                                                        const std::vector<double>& spacings,
                                                        const std::function<void()>& tick) {
  std::vector<VisualOdometryPoint> points;
  for (const double spacing : spacings) {
    const int steps = static_cast<int>(std::lround(options.way / spacing));
    VisualOdometryPoint point;
    point.spacing = options.way / steps;
    std::vector<Vector6d> errors;
    for (int i = 0; i < options.runs; ++i) {
      RandomDraws random(options.seed + static_cast<std::uint64_t>(i));
      errors.push_back(run(options, steps, random, point));
      tick();
    }
    summarise(errors, point);
    points.push_back(point);
  }
  return points;
}

}  // namespace sckf
