// Planar rigid motions, with Jacobians.
//
// Convention of the error state, here and in the whole package: additive, X̃ = X − X̂, with X = [x, y, yaw] in
// m, m, rad, and the yaw part wrapped to (−π, π]. Every covariance of a pose is the covariance of this X̃, with
// rows and columns in the order x, y, yaw, expressed in the frame in which the pose is.
#pragma once

#include <Eigen/Core>

namespace sckf {

/// The angle [rad], wrapped to (−π, π]. The one place of the package that wraps angles.
double wrapAngle(double angle);

/// A pose, or a displacement, in the plane. Named a_from_b it takes coordinates in frame b to coordinates in frame a.
struct SE2 {
  double x = 0.0;    ///< [m]
  double y = 0.0;    ///< [m]
  double yaw = 0.0;  ///< [rad], in (−π, π]

  SE2() = default;
  SE2(double x_, double y_, double yaw_) : x(x_), y(y_), yaw(wrapAngle(yaw_)) {}
  explicit SE2(const Eigen::Vector3d& v) : SE2(v.x(), v.y(), v.z()) {}

  Eigen::Vector2d translation() const { return {x, y}; }
  Eigen::Matrix2d rotation() const;
  Eigen::Vector3d vector() const { return {x, y, yaw}; }
  Eigen::Vector2d operator*(const Eigen::Vector2d& point) const { return rotation() * point + translation(); }
};

/// A displacement that is applied to many points: its sine and cosine taken once.
struct RigidMotion {
  explicit RigidMotion(const SE2& x) : C(x.rotation()), t(x.translation()) {}

  Eigen::Vector2d operator*(const Eigen::Vector2d& point) const { return C * point + t; }

  Eigen::Matrix2d C;
  Eigen::Vector2d t;  ///< [m]
};

/// 𝒥 p = [0 −1; 1 0] p: p turned by a quarter, the derivative of C(φ) p by φ at φ = 0.
inline Eigen::Vector2d quarterTurn(const Eigen::Vector2d& p) { return {-p.y(), p.x()}; }

/// a ⊕ b: the pose whose coordinates in frame a are b. Jacobians (3 × 3) are of the additive error, see above.
SE2 compose(const SE2& a, const SE2& b, Eigen::Matrix3d* J_out_a = nullptr, Eigen::Matrix3d* J_out_b = nullptr);

/// ⊖ a, so that compose(a, inverse(a)) is the identity.
SE2 inverse(const SE2& a, Eigen::Matrix3d* J_out_a = nullptr);

/// ⊖ a ⊕ b: the pose b seen from a.
SE2 between(const SE2& a, const SE2& b, Eigen::Matrix3d* J_out_a = nullptr, Eigen::Matrix3d* J_out_b = nullptr);

/// The additive error a − b with its yaw wrapped: X̃ = error(X, X̂).
Eigen::Vector3d error(const SE2& a, const SE2& b);

/// a + e, with the yaw wrapped: X = corrected(X̂, X̃).
SE2 corrected(const SE2& a, const Eigen::Vector3d& e);

}  // namespace sckf
