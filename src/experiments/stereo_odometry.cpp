#include "sckf_odometry/experiments/stereo_odometry.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

namespace sckf {

namespace {

/// A feature that both views have: its place in either, its points there and how they depend on the pixels.
struct SharedFeature {
  Eigen::Index in_reference, in_current;
  Eigen::Vector3d reference, current;
  Eigen::Matrix3d reference_by_pixels, current_by_pixels;
};

std::vector<SharedFeature> findShared(const StereoCamera& camera, const StereoView& reference,
                                      const StereoView& current) {
  std::vector<SharedFeature> shared;
  std::size_t r = 0;
  std::size_t c = 0;
  while (r < reference.features.size() && c < current.features.size()) {
    if (reference.features[r] < current.features[c]) {
      ++r;
    } else if (current.features[c] < reference.features[r]) {
      ++c;
    } else {
      SharedFeature f;
      f.in_reference = static_cast<Eigen::Index>(r);
      f.in_current = static_cast<Eigen::Index>(c);
      f.reference = camera.triangulate(reference.pixels[r++], &f.reference_by_pixels);
      f.current = camera.triangulate(current.pixels[c++], &f.current_by_pixels);
      shared.push_back(f);
    }
  }
  return shared;
}

/// Of e = point in the reference − x ⊕ point in the current view.
struct Linearised {
  Eigen::Vector3d e;
  Eigen::Matrix<double, 3, 6> A;  // ∂e/∂x
  Eigen::Matrix3d W;              // inverse of the covariance of e, for pixels of unit variance
};

Linearised linearise(const SharedFeature& f, const SE3& x) {
  const Eigen::Matrix3d current_by_pixels = x.rotation * f.current_by_pixels;
  Linearised l;
  l.e = f.reference - x * f.current;
  l.A << -Eigen::Matrix3d::Identity(), crossMatrix(x.rotation * f.current);
  const Eigen::Matrix3d covariance =
      f.reference_by_pixels * f.reference_by_pixels.transpose() + current_by_pixels * current_by_pixels.transpose();
  l.W = covariance.inverse();
  return l;
}

SE3 align(const std::vector<SharedFeature>& shared, SE3 x, Matrix6d& information) {
  constexpr int kIterations = 4;  // noise moves the solution by little: the first two do nearly all
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    information.setZero();
    Vector6d gradient = Vector6d::Zero();
    for (const SharedFeature& f : shared) {
      const Linearised l = linearise(f, x);
      information += l.A.transpose() * l.W * l.A;
      gradient += l.A.transpose() * l.W * l.e;
    }
    x = corrected(x, -information.ldlt().solve(gradient));
  }
  return x;
}

}  // namespace

Eigen::Vector3d StereoCamera::project(const Eigen::Vector3d& p) const {
  return Eigen::Vector3d(p.x(), p.y(), p.x() - baseline) * (focal_length / p.z());
}

bool StereoCamera::sees(const Eigen::Vector3d& p) const {
  if (p.z() < near || p.z() > far) return false;
  const Eigen::Vector3d pixels = project(p);
  return std::abs(pixels.x()) < half_width && std::abs(pixels.z()) < half_width && std::abs(pixels.y()) < half_height;
}

Eigen::Vector3d StereoCamera::triangulate(const Eigen::Vector3d& pixels, Eigen::Matrix3d* J_point_pixels) const {
  const double disparity = pixels.x() - pixels.z();
  const double scale = baseline / disparity;
  const Eigen::Vector3d point = scale * Eigen::Vector3d(pixels.x(), pixels.y(), focal_length);
  const Eigen::Vector3d by_disparity = -point / disparity;
  *J_point_pixels << by_disparity, Eigen::Vector3d::Zero(), -by_disparity;
  (*J_point_pixels)(0, 0) += scale;
  (*J_point_pixels)(1, 1) += scale;
  return point;
}

StereoDisplacement matchViews(const StereoCamera& camera, const StereoView& reference, const StereoView& current,
                              double pixel_std, const SE3& guess) {
  const std::vector<SharedFeature> shared = findShared(camera, reference, current);
  const auto columns = [](const StereoView& view) { return 3 * static_cast<Eigen::Index>(view.features.size()); };
  StereoDisplacement z;
  z.shared = static_cast<int>(shared.size());
  z.measurement.seen = Matrix6d::Identity();
  z.measurement.J_reference = Eigen::MatrixXd::Zero(6, columns(reference));
  z.measurement.J_current = Eigen::MatrixXd::Zero(6, columns(current));
  z.measurement.variance_current = Eigen::VectorXd::Constant(columns(current), pixel_std * pixel_std);
  z.measurement.matching_noise = Matrix6d::Zero();
  if (shared.size() < 3) return z;
  Matrix6d information;
  z.reference_from_current = align(shared, guess, information);
  const Eigen::LDLT<Matrix6d> solver(information);
  for (const SharedFeature& f : shared) {  // ∂x/∂z = −(Σ Aᵀ W A)⁻¹ Aᵀ W ∂e/∂z
    const Linearised l = linearise(f, z.reference_from_current);
    const Eigen::Matrix<double, 6, 3> by_error = -solver.solve(l.A.transpose() * l.W);
    z.measurement.J_reference.middleCols<3>(3 * f.in_reference) = by_error * f.reference_by_pixels;
    z.measurement.J_current.middleCols<3>(3 * f.in_current) =
        -by_error * z.reference_from_current.rotation * f.current_by_pixels;
  }
  return z;
}

}  // namespace sckf
