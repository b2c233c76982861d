// Rigid motions in space, with Jacobians.
//
// The error is that of se2.h in one dimension more: X̃ = [p − p̂; Log(R R̂ᵀ)] in m, m, m, rad, rad, rad, position and
// rotation both in the frame in which the pose is.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace sckf {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// A pose, or a displacement. Named a_from_b it takes coordinates in frame b to coordinates in frame a.
struct SE3 {
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  ///< [m]
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();

  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const { return rotation * point + translation; }
};

/// v ×, as a matrix.
Eigen::Matrix3d crossMatrix(const Eigen::Vector3d& v);

/// The rotation about an axis by its length [rad], and back, with a length of at most π.
Eigen::Matrix3d rotationExp(const Eigen::Vector3d& axis_angle);
Eigen::Vector3d rotationLog(const Eigen::Matrix3d& rotation);

/// a ⊕ b. Jacobians (6 × 6) are of the error above.
SE3 compose(const SE3& a, const SE3& b, Matrix6d* J_out_a = nullptr, Matrix6d* J_out_b = nullptr);

/// ⊖ a ⊕ b: the pose b seen from a.
SE3 between(const SE3& a, const SE3& b);

/// X̃ = error(X, X̂), and back: X = corrected(X̂, X̃).
Vector6d error(const SE3& a, const SE3& b);
SE3 corrected(const SE3& a, const Vector6d& e);

}  // namespace sckf
