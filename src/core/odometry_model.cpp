#include "sckf_odometry/core/odometry_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "sckf_odometry/core/covariance.h"

namespace sckf {

namespace {

double square(double v) { return v * v; }

/// Variances of a translation and of yaw that a way [m] and a rotation [rad], both ≥ 0, add.
struct Variances {
  Variances(double way, double rotation, const OdometryNoise& noise)
      : translation(square(noise.translation_per_meter) * way + square(noise.translation_per_radian) * rotation),
        yaw(square(noise.yaw_per_meter) * way + square(noise.yaw_per_radian) * rotation) {}

  double translation;
  double yaw;
};

Eigen::Matrix3d omnidirectional(const SE2& motion, const OdometryNoise& noise) {
  const Variances added(motion.translation().norm(), std::abs(motion.yaw), noise);
  return Eigen::Vector3d(added.translation, added.translation, added.yaw).asDiagonal();
}

/// A motion with a velocity that is constant in base_link: a straight line, or an arc.
class Arc {
 public:
  explicit Arc(const SE2& motion) : end_(motion.translation()), rotation_(motion.yaw) {
    const SE2 back(0.0, 0.0, -0.5 * rotation_);
    ways_ = back.rotation() * end_ / chord(rotation_);
  }

  double ahead() const { return ways_.x(); }     ///< the way in the direction of x of base_link, with its sign [m]
  double way() const { return ways_.norm(); }    ///< [m]
  double rotation() const { return rotation_; }  ///< [rad]

  /// What an error made after a share u of the motion, in base_link then, has become at its end, in base_link before.
  Eigen::Matrix3d carriedToTheEnd(double u) const {
    const SE2 half(0.0, 0.0, 0.5 * u * rotation_);
    const Eigen::Vector2d ahead = end_ - u * chord(u * rotation_) * (half.rotation() * ways_);
    Eigen::Matrix3d G = Eigen::Matrix3d::Identity();
    G.topLeftCorner<2, 2>() = SE2(0.0, 0.0, u * rotation_).rotation();
    G.topRightCorner<2, 1>() << -ahead.y(), ahead.x();
    return G;
  }

 private:
  /// The chord of an arc over its length.
  static double chord(double angle) { return std::abs(angle) < 1e-9 ? 1.0 : std::sin(0.5 * angle) / (0.5 * angle); }

  Eigen::Vector2d end_;
  Eigen::Vector2d ways_;
  double rotation_;
};

/// ∫ G W Gᵀ over the arc, by Gauss's formula: exact on a straight line, and never indefinite.
Eigen::Matrix3d drivenAlong(const Arc& arc, const Eigen::Matrix3d& W) {
  static const double kNode = 0.5 * std::sqrt(0.6);
  const std::array<std::array<double, 2>, 3> nodes{
      {{0.5 - kNode, 5.0 / 18.0}, {0.5, 4.0 / 9.0}, {0.5 + kNode, 5.0 / 18.0}}};
  Eigen::Matrix3d Q = Eigen::Matrix3d::Zero();
  for (const auto& [u, weight] : nodes) {
    const Eigen::Matrix3d G = arc.carriedToTheEnd(u);
    Q += weight * G * W * G.transpose();
  }
  return symmetric(Q);
}

/// Of the errors ahead and in yaw of two wheels whose noise grows with their ways r and l: (|r| − |l|) / (|r| + |l|).
double wheelCorrelation(const Arc& arc, const OdometryNoise& noise) {
  const double by_base = noise.translation_per_meter * arc.rotation();  // (r − l) c / 2
  const double by_way = noise.yaw_per_meter * arc.ahead();              // (r + l) c / 2
  const double larger = std::max(std::abs(by_base), std::abs(by_way));
  return larger == 0.0 ? 0.0 : (by_base / larger) * (by_way / larger);
}

Eigen::Matrix3d differential(const SE2& motion, const OdometryNoise& noise) {
  const Arc arc(motion);
  const Variances added(arc.way(), std::abs(arc.rotation()), noise);
  Eigen::Matrix3d W = Eigen::Matrix3d::Zero();
  W.diagonal() << added.translation, square(noise.lateral_share) * added.translation, added.yaw;
  W(0, 2) = W(2, 0) = wheelCorrelation(arc, noise) * std::sqrt(added.translation * added.yaw);
  return drivenAlong(arc, W);
}

Eigen::Matrix3d ackermann(const SE2& motion, const OdometryNoise& noise) {
  constexpr double kSmallestRadius = 0.3;  // [m], that of a model car
  const Arc arc(motion);
  const double rotation = std::abs(arc.rotation());
  const double steered = std::min(rotation, arc.way() / kSmallestRadius);
  const double ahead = square(noise.translation_per_meter) * arc.way();
  const double yaw =
      square(noise.yaw_per_meter) * arc.way() + square(noise.yaw_per_radian) * steered + rotation - steered;
  const double sharpest = 1.0 / kSmallestRadius;
  const double curvature = arc.ahead() == 0.0 ? 0.0 : std::clamp(arc.rotation() / arc.ahead(), -sharpest, sharpest);
  const Eigen::Vector3d k(1.0, 0.0, curvature);
  Eigen::Matrix3d W = ahead * k * k.transpose();
  W.diagonal() += Eigen::Vector3d(0.0, square(noise.lateral_share) * ahead, yaw);
  return drivenAlong(arc, W);
}

}  // namespace

const std::vector<std::string>& odometryModelNames() {
  static const std::vector<std::string> kNames{"omnidirectional", "differential", "ackermann"};
  return kNames;
}

OdometryIncrement modelledIncrement(const SE2& before_from_after, const OdometryNoise& noise) {
  if (noise.model == "omnidirectional") return {before_from_after, omnidirectional(before_from_after, noise)};
  if (noise.model == "differential") return {before_from_after, differential(before_from_after, noise)};
  if (noise.model == "ackermann") return {before_from_after, ackermann(before_from_after, noise)};
  std::string known;
  for (const std::string& name : odometryModelNames()) known += (known.empty() ? "" : ", ") + name;
  throw std::invalid_argument("odometry model is \"" + noise.model + "\": expected one of " + known);
}

OdometryIncrement statedIncrement(const SE2& before_from_after, const Eigen::Matrix3d& twist_covariance, double dt,
                                  double interval) {
  return {before_from_after, twist_covariance * dt * interval};
}

bool sensibleTwistCovariance(const Eigen::Matrix3d& twist_covariance) {
  constexpr double kUnknown = 1e3;  // drivers write 1e3, 1e6, 1e9 for what they do not measure
  const double scale = twist_covariance.cwiseAbs().maxCoeff();
  return isCovariance(twist_covariance) && scale > 0.0 && scale < kUnknown;
}

}  // namespace sckf
