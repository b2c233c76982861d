#include "sckf_odometry/core/multi_clone_filter.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <cmath>
#include <limits>
#include <utility>

#include "sckf_odometry/core/covariance.h"
#include "sckf_odometry/core/world_error.h"

namespace sckf {

namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using world_error::additive;
using world_error::adjoint;
using world_error::exponential;
using world_error::inverseOfAdditive;
using world_error::logarithm;

constexpr double kNoBound = std::numeric_limits<double>::infinity();
const Eigen::RowVector3d kYaw(0.0, 0.0, 1.0);

/// A column of the identity for each element that is not zero.
WheelCalibration::Columns columnsOf(const WheelCalibration::Vector& v) {
  WheelCalibration::Columns columns(v.size(), (v.array() != 0.0).count());
  Eigen::Index column = 0;
  for (Eigen::Index i = 0; i < v.size(); ++i) {
    if (v(i) != 0.0) columns.col(column++) = WheelCalibration::Vector::Unit(i);
  }
  return columns;
}

}  // namespace

MultiCloneFilter::MultiCloneFilter(const SE2& odom_from_base, const Matrix3d& covariance, const StateOptions& states)
    : options_(states),
      origin_(odom_from_base.translation()),
      pose_(0.0, 0.0, odom_from_base.yaw),
      calibrated_(columnsOf(states.calibration_std)) {
  pose_error_ = errors_.add(covariance);
  if (calibrated_.cols() > 0) beginCalibration(states.known_calibration);
  if (states.gyro_bias_std > 0.0) {
    const double variance = states.gyro_bias_std * states.gyro_bias_std;
    const GyroBias bias = states.known_gyro_bias.value_or(GyroBias{0.0, variance});
    gyro_bias_ = bias.value;
    gyro_bias_error_ = errors_.add(MatrixXd::Constant(1, 1, bias.variance));
  }
  clone(Eigen::VectorXd(0));  // (6)(7)
}

SE2 MultiCloneFilter::inWorld(const SE2& pose) const { return {origin_.x() + pose.x, origin_.y() + pose.y, pose.yaw}; }

Matrix3d MultiCloneFilter::covariance() const {
  const Matrix3d T = additive(pose_);
  return symmetric(T * errors_.covariance(pose_error_) * T.transpose());
}

double MultiCloneFilter::varianceOf(const std::optional<Part>& part) const {
  return part ? errors_.covariance(*part)(0, 0) : 0.0;
}

WheelCalibration MultiCloneFilter::calibration() const {
  if (!calibration_error_) return {};
  return {calibration_, calibrated_ * symmetric(errors_.covariance(*calibration_error_)) * calibrated_.transpose()};
}

// ---- displacements

void MultiCloneFilter::beginScan() {
  if (present_) errors_.removeRanges(*present_);
  present_.reset();
}

DisplacementPrediction MultiCloneFilter::predictedDisplacementFrom(std::size_t clone) const {
  Matrix3d J;
  const SE2 reference_from_current = between(clones_[clone].pose, pose_, nullptr, &J);  // (16)
  const Matrix3d H = J * additive(pose_);
  const Matrix3d cross = errors_.covariance(pose_error_, clones_[clone].error);
  const Matrix3d difference =
      errors_.covariance(pose_error_) + errors_.covariance(clones_[clone].error) - cross - cross.transpose();
  return {reference_from_current, H * difference * H.transpose()};
}

Innovation MultiCloneFilter::innovation(const Displacement& z) const {
  Innovation r;
  Matrix3d H_k;
  Matrix3d H_x;
  const SE2 z_hat = between(clones_[z.clone].pose, pose_, &H_k, &H_x);  // (16)
  r.H_clone = z.observable * H_k;                                       // (18)
  r.H_pose = z.observable * H_x;
  // (17), projected on V_o, along the arc that a correction makes: where the wheels have slipped, it is long.
  const Vector3d seen = z.fromObservable() * (z.observable * error(z.reference_from_current, z_hat));
  const SE2 measured = compose(clones_[z.clone].pose, corrected(z_hat, seen));  // as predicted where nothing is seen
  r.residual = r.H_pose * additive(pose_) * logarithm(compose(measured, inverse(pose_)));
  r.noise = carriedOver(z.J_current, z.variance_current) + z.matching_noise;
  ErrorState::Correlation with_r = errors_.correlate(measurement(z, r));
  r.covariance = with_r.innovation;                     // (19)
  r.gain = additive(pose_) * with_r.gain(pose_error_);  // (21)
  r.with_state = std::move(with_r.state);
  return r;
}

ErrorState::Measurement MultiCloneFilter::measurement(const Displacement& z, const Innovation& r) const {
  const Clone& clone = clones_[z.clone];
  const MatrixXd H = r.H_pose * additive(pose_);
  Measurement m{r.residual, {{pose_error_, H}, {clone.error, -H}}, {{clone.ranges, z.J_reference}}, r.noise};
  if (present_) {
    m.ranges.push_back({*present_, z.J_current});
    m.noise = z.matching_noise;
  }
  return m;
}

void MultiCloneFilter::update(const Displacement& z, const Innovation& r) {
  if (!present_) present_ = errors_.addRanges(z.variance_current);
  const bool newest = z.clone == 0;
  correct(measurement(z, r), {r.with_state, r.covariance}, newest ? statesNotCloned() : allStates(),
          newest ? clones_.front().error : clones_.back().error);  // (22)(23)
}

void MultiCloneFilter::clone(const Eigen::VectorXd& range_variances) {
  const bool start_is_reference = clones_.size() == 1 && errors_.variances(clones_.front().ranges).size() == 0;
  if (start_is_reference) forget(0);  // which was no scan
  if (present_ && errors_.variances(*present_).size() != range_variances.size()) beginScan();
  if (!present_) present_ = errors_.addRanges(range_variances);  // not used: independent of all poses
  forgetCalibration();
  clones_.insert(clones_.begin(), {pose_, errors_.addCloneOf(pose_error_), *present_});  // (24)-(27)
  present_.reset();
}

void MultiCloneFilter::forget(std::size_t clone) {
  errors_.remove(clones_[clone].error);
  errors_.removeRanges(clones_[clone].ranges);
  clones_.erase(clones_.begin() + static_cast<std::ptrdiff_t>(clone));
}

void MultiCloneFilter::loosen(const Matrix3d& covariance) {
  Matrix3d G;
  compose(pose_, SE2(), nullptr, &G);
  const Matrix3d W = inverseOfAdditive(pose_) * G;
  errors_.disturb(pose_error_, symmetric(W * covariance * W.transpose()));
}

// ---- other measurements

double MultiCloneFilter::update(const PoseMeasurement& measured, double nis_bound) {
  const SE2 local(measured.pose.x - origin_.x(), measured.pose.y - origin_.y(), measured.pose.yaw);
  const Matrix3d T_inverse = inverseOfAdditive(local);
  Measurement m;
  m.residual = logarithm(compose(local, inverse(pose_)));
  m.terms.push_back({pose_error_, Matrix3d::Identity()});  // (34)
  m.noise = symmetric(T_inverse * measured.covariance * T_inverse.transpose());
  return update(m, nis_bound);
}

double MultiCloneFilter::updateHeading(double yaw, double variance, double nis_bound) {
  if (!compass_error_) {
    compass_from_world_ = yaw - pose_.yaw;
    compass_error_ = errors_.add(MatrixXd::Constant(1, 1, variance));
    errors_.move(*compass_error_, -kYaw, pose_error_);
    return 0.0;
  }
  Measurement m;
  m.residual = Eigen::VectorXd::Constant(1, wrapAngle(yaw - compass_from_world_ - pose_.yaw));
  m.terms.push_back({pose_error_, kYaw});
  m.terms.push_back({*compass_error_, MatrixXd::Ones(1, 1)});
  m.noise = MatrixXd::Constant(1, 1, variance);
  return update(m, nis_bound);
}

double MultiCloneFilter::update(const Measurement& m, double nis_bound) {
  const ErrorState::Correlation with_r = errors_.correlate(m);
  const double nis = normalisedSquare(m.residual, with_r.innovation);
  if (!std::isfinite(nis) || nis > nis_bound) return nis;
  places_told_ = true;
  correct(m, with_r, allStates(), std::nullopt);
  return nis;
}

void MultiCloneFilter::enterWorld(const PoseMeasurement& world_from_base) {
  const SE2 pose_there(0.0, 0.0, world_from_base.pose.yaw);
  const SE2 d = compose(pose_there, inverse(pose_));
  const Matrix3d Ad = adjoint(d);
  // Until the pose is told, the whole may be anywhere: as far away as no building is large, and turned anyhow.
  const Part unknown = errors_.add(Vector3d(1e4, 1e4, 100.0).asDiagonal().toDenseMatrix());
  const auto enter = [&](SE2& pose, Part pose_error) {
    pose = compose(d, pose);
    errors_.move(pose_error, Ad - Matrix3d::Identity(), pose_error);
    errors_.move(pose_error, Matrix3d::Identity(), unknown);
  };
  enter(pose_, pose_error_);
  for (Clone& clone : clones_) enter(clone.pose, clone.error);
  for (Landmark& landmark : landmarks_) enter(landmark.pose, landmark.error);
  turnCalibration(d.yaw, unknown);
  compass_from_world_ -= d.yaw;
  if (compass_error_) errors_.move(*compass_error_, -kYaw, unknown);
  errors_.remove(unknown);
  origin_ = world_from_base.pose.translation();
  update(world_from_base, kNoBound);
}

// ---- what is corrected

std::vector<ErrorState::Part> MultiCloneFilter::statesNotCloned() const {
  std::vector<Part> parts{pose_error_};
  for (const auto& part : {calibration_error_, gyro_bias_error_, compass_error_}) {
    if (part) parts.push_back(*part);
  }
  for (const Landmark& landmark : landmarks_) parts.push_back(landmark.error);
  return parts;
}

std::vector<ErrorState::Part> MultiCloneFilter::allStates() const {
  std::vector<Part> parts = statesNotCloned();
  for (const Clone& clone : clones_) parts.push_back(clone.error);
  return parts;
}

/// The pose, clone or landmark whose error a part is; null if it is that of another state.
SE2* MultiCloneFilter::placeOf(const Part& part) {
  if (part.row == pose_error_.row) return &pose_;
  for (Clone& clone : clones_) {
    if (part.row == clone.error.row) return &clone.pose;
  }
  for (Landmark& landmark : landmarks_) {
    if (part.row == landmark.error.row) return &landmark.pose;
  }
  return nullptr;
}

/// E{x̃ rᵀ} of a part, size × d, as far as both have the noise of the measurement's scans in common: of each s = J z̃
/// what r tells of it, and what that tells of the part.
MatrixXd MultiCloneFilter::commonByRanges(const Part& part, const Measurement& m) const {
  const Eigen::Index d = m.residual.size();
  MatrixXd common = MatrixXd::Zero(part.size, d);
  for (const auto& scan : m.ranges) {
    const ErrorState::Correlation with_s = errors_.correlate({m.residual, {}, {scan}, MatrixXd::Zero(d, d)});
    MatrixXd s_r = with_s.innovation;
    for (const auto& [other, H] : m.terms) {
      s_r += (H * with_s.state.middleRows(other.row, other.size)).transpose();
    }
    common +=
        with_s.state.middleRows(part.row, part.size) * with_s.innovation.completeOrthogonalDecomposition().solve(s_r);
  }
  return common;
}

/// What is learned of the wheels tells where the anchor must have been, too, since they led there: by so much it would
/// be corrected, size × d. Where nothing but displacements tells where poses are, all of its correction is learned so,
/// but for what scans have in common. The covariance alone would not say so: what was learned before has not corrected
/// the anchor either, and where the wheels led far, its error is radians that go with the noise of those displacements.
MatrixXd MultiCloneFilter::learnedOf(const Part& anchor, const Measurement& measurement,
                                     const ErrorState::Correlation& with_r) const {
  if (!places_told_) {
    const MatrixXd by_poses = with_r.state.middleRows(anchor.row, anchor.size) - commonByRanges(anchor, measurement);
    return with_r.innovation.llt().solve(by_poses.transpose()).transpose();
  }
  MatrixXd learned = MatrixXd::Zero(anchor.size, with_r.innovation.cols());
  for (const auto& part : {calibration_error_, gyro_bias_error_}) {
    if (!part) continue;
    const MatrixXd by_wheels = errors_.covariance(*part).ldlt().solve(errors_.covariance(*part, anchor)).transpose();
    learned += by_wheels * with_r.gain(*part);
  }
  return learned;
}

/// Those that are best, but for one thing: a displacement tells where poses are relative to each other, and what it
/// tells of the wheels is for the way to come. They led all the way behind, too. If that were corrected as well, all of
/// it would turn about where the estimate began, odom → base_link would jump by metres, and pose and reference would
/// come apart where the wheels slip, since corrections of that size do not just add.
std::vector<ErrorState::Gain> MultiCloneFilter::gains(const Measurement& measurement,
                                                      const ErrorState::Correlation& with_r,
                                                      const std::vector<Part>& parts,
                                                      const std::optional<Part>& anchor) {
  std::vector<ErrorState::Gain> gains;
  gains.reserve(parts.size());
  const MatrixXd best = with_r.gain();
  for (const Part& part : parts) gains.push_back({part, best.middleRows(part.row, part.size)});
  if (!anchor || !(calibration_error_ || gyro_bias_error_)) return gains;
  const MatrixXd learned = learnedOf(*anchor, measurement, with_r);
  for (auto& [part, K] : gains) {
    if (placeOf(part) != nullptr) K -= learned;
  }
  return gains;
}

std::vector<Eigen::VectorXd> MultiCloneFilter::correct(const Measurement& measurement,
                                                       const ErrorState::Correlation& with_r,
                                                       const std::vector<Part>& parts,
                                                       const std::optional<Part>& anchor) {
  const std::vector<ErrorState::Gain> gains = this->gains(measurement, with_r, parts, anchor);
  errors_.update(measurement, with_r, gains);
  std::vector<Eigen::VectorXd> corrections;
  corrections.reserve(parts.size());
  for (const auto& [part, K] : gains) {
    const Eigen::VectorXd& c = corrections.emplace_back(K * measurement.residual);
    const auto is = [row = part.row](const std::optional<Part>& other) { return other && other->row == row; };
    if (SE2* place = placeOf(part)) *place = compose(exponential(c), *place);
    if (is(calibration_error_)) calibration_ += calibrated_ * c;
    if (is(gyro_bias_error_)) gyro_bias_ += c(0);
    if (is(compass_error_)) compass_from_world_ += c(0);
  }
  return corrections;
}

}  // namespace sckf
