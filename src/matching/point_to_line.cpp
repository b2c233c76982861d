#include "sckf_odometry/matching/point_to_line.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
namespace sckf {
namespace {
Eigen::Vector2d quarterTurn(const Eigen::Vector2d& p) { return {-p.y(), p.x()}; }
}  // namespace
void PointToLine::setPairs(const std::vector<Pair>& candidates, const SE2& x, const MatcherOptions& o) {
  pairs_.clear();
  inv_std_.clear();
  const Eigen::Matrix2d R = x.rotation();
  std::vector<double> normalised;
  for (const Pair& pair : candidates) {
    const Surface& s = ref_.surface[pair.reference];
    if (!s.valid()) continue;
    const Eigen::Vector2d ru = R * cur_.ray[pair.current];
    const double incidence = s.normal.dot(ru);
    if (incidence > 0) continue;
    const Surface& c = cur_.surface[pair.current];
    if (c.valid() && s.normal.dot(R * c.normal) < o.min_normal_cosine) continue;
    const Eigen::Vector2d q = R * cur_.point[pair.current] + x.translation();
    const double along = quarterTurn(s.normal).dot(q - s.centroid);
    const double e = s.normal.dot(q - s.centroid);
    const double n = s.size();
    const double cos_ref = s.normal.dot(ref_.ray[pair.reference]);
    const double var = std::pow(cur_.range_noise * incidence, 2) +
                       std::pow(ref_.range_noise * cos_ref, 2) * (1.0 / n + along * along / s.spread) +
                       o.surface_roughness * o.surface_roughness;
    const double w = 1.0 / std::sqrt(var);
    pairs_.push_back(pair);
    inv_std_.push_back(w);
    normalised.push_back(std::abs(e * w));
  }
  if (!normalised.empty()) {
    auto mid = normalised.begin() + normalised.size() / 2;
    std::nth_element(normalised.begin(), mid, normalised.end());
    huber_ = o.huber * std::max(1.0, 1.4826 * *mid);
  }
}
SE2 PointToLine::step(const SE2& x, const Eigen::Matrix3d* prior, const SE2& prior_mean) const {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  const Eigen::Matrix2d R = x.rotation();
  for (std::size_t i = 0; i < pairs_.size(); ++i) {
    const Surface& s = ref_.surface[pairs_[i].reference];
    const Eigen::Vector2d lever = R * cur_.point[pairs_[i].current];
    const double e = s.normal.dot(lever + x.translation() - s.centroid) * inv_std_[i];
    const double w = std::abs(e) <= huber_ ? 1.0 : huber_ / std::abs(e);
    Eigen::Vector3d A;
    A << s.normal, s.normal.dot(quarterTurn(lever));
    A *= inv_std_[i];
    H += w * A * A.transpose();
    g += w * e * A;
  }
  if (prior != nullptr) {
    H += *prior;
    g += *prior * error(x, prior_mean);
  }
  return corrected(x, -H.ldlt().solve(g));
}
std::optional<Displacement> PointToLine::solve(const SE2& start, const MatcherOptions& o) {
  // information, spurious information by the noise of the normals
  const Eigen::Matrix2d R0 = start.rotation();
  Eigen::Matrix3d I = Eigen::Matrix3d::Zero(), spurious = Eigen::Matrix3d::Zero();
  double lever2 = 0;
  for (std::size_t i = 0; i < pairs_.size(); ++i) {
    const Surface& s = ref_.surface[pairs_[i].reference];
    const Eigen::Vector2d lever = R0 * cur_.point[pairs_[i].current];
    lever2 += lever.squaredNorm();
    Eigen::Vector3d A, B;
    A << s.normal, s.normal.dot(quarterTurn(lever));
    const Eigen::Vector2d t = quarterTurn(s.normal);
    B << t, t.dot(quarterTurn(lever));
    const double e = s.normal.dot(lever + start.translation() - s.centroid) * inv_std_[i];
    if (std::abs(e) > huber_) continue;
    const double var_angle = std::pow(ref_.range_noise, 2) / s.spread;
    I += inv_std_[i] * inv_std_[i] * A * A.transpose();
    spurious += inv_std_[i] * inv_std_[i] * var_angle * B * B.transpose();
  }
  const double L = std::sqrt(lever2 / pairs_.size());
  const Eigen::Vector3d scale(1.0, 1.0, 1.0 / L);
  const Eigen::Matrix3d Is = scale.asDiagonal() * I * scale.asDiagonal();
  const Eigen::Matrix3d Ss = scale.asDiagonal() * spurious * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eig(Is);
  std::vector<int> seen;
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d v = eig.eigenvectors().col(k);
    const double true_info = v.dot((Is - Ss) * v);
    if (true_info * o.max_std * o.max_std > 1.0 && eig.eigenvalues()(k) > o.min_information_ratio * v.dot(Ss * v))
      seen.push_back(k);
  }
  if (seen.empty()) return std::nullopt;
  const int d = static_cast<int>(seen.size());
  Eigen::Matrix<double, 3, Eigen::Dynamic> V(3, d);  // columns: directions in x that are seen, x = V y
  Displacement z;
  z.observable.resize(d, 3);
  for (int k = 0; k < d; ++k) {
    V.col(k) = scale.cwiseProduct(eig.eigenvectors().col(seen[k]));
    z.observable.row(k) = eig.eigenvectors().col(seen[k]).cwiseQuotient(scale).transpose();
  }
  // Newton in the seen directions, pairs and weights fixed
  SE2 x = start;
  Eigen::Matrix3d H;
  for (int it = 0; it < 20; ++it) {
    H.setZero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    const Eigen::Matrix2d R = x.rotation();
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      const Surface& s = ref_.surface[pairs_[i].reference];
      const Eigen::Vector2d lever = R * cur_.point[pairs_[i].current];
      const double e = s.normal.dot(lever + x.translation() - s.centroid) * inv_std_[i];
      const bool in = std::abs(e) <= huber_;
      const double psi = in ? e : std::copysign(huber_, e);
      Eigen::Vector3d A;
      A << s.normal, s.normal.dot(quarterTurn(lever));
      A *= inv_std_[i];
      if (in) H += A * A.transpose();
      H(2, 2) -= psi * inv_std_[i] * s.normal.dot(lever);
      g += psi * A;
    }
    const Eigen::VectorXd dy = -(V.transpose() * H * V).ldlt().solve(V.transpose() * g);
    x = corrected(x, V * dy);
    if (dy.norm() < 1e-10) break;
  }
  z.reference_from_current = x;
  // J
  const Eigen::MatrixXd M = (V.transpose() * H * V).inverse() * V.transpose();
  const Eigen::Matrix2d R = x.rotation();
  Eigen::Matrix3Xd Gr = Eigen::Matrix3Xd::Zero(3, ref_.beams), Gc = Eigen::Matrix3Xd::Zero(3, cur_.beams);
  double chi2 = 0;
  int used = 0;
  // cluster-robust: correlated neighbours
  for (std::size_t i = 0; i < pairs_.size(); ++i) {
    const Surface& s = ref_.surface[pairs_[i].reference];
    const int c = pairs_[i].current;
    const Eigen::Vector2d lever = R * cur_.point[c];
    const Eigen::Vector2d off = lever + x.translation() - s.centroid;
    const double e = s.normal.dot(off) * inv_std_[i];
    const bool in = std::abs(e) <= huber_;
    const double psi = in ? e : std::copysign(huber_, e);
    chi2 += psi * psi;
    ++used;
    const Eigen::Vector2d t = quarterTurn(s.normal);
    const double along = t.dot(off);
    Eigen::Vector3d A;
    A << s.normal, s.normal.dot(quarterTurn(lever));
    A *= inv_std_[i];
    Eigen::Vector3d B;
    B << t, t.dot(quarterTurn(lever));
    B *= inv_std_[i];  // dA/dtheta
    const Eigen::Vector2d ru = R * cur_.ray[c];
    Eigen::Vector3d gc = Eigen::Vector3d::Zero();
    if (in) gc += A * (inv_std_[i] * s.normal.dot(ru));
    gc.z() += psi * inv_std_[i] * s.normal.dot(quarterTurn(ru));
    Gc.col(cur_.beam[c]) += gc;
    for (int j = s.first; j <= s.last; ++j) {
      const Eigen::Vector2d dj = ref_.point[j] - s.centroid;
      const Eigen::Vector2d& u = ref_.ray[j];
      const double dtheta = -(t.dot(u) * s.normal.dot(dj) + t.dot(dj) * s.normal.dot(u)) / s.spread;
      const double de = (-s.normal.dot(u) / s.size() + along * dtheta) * inv_std_[i];
      Eigen::Vector3d gr = psi * dtheta * B;
      if (in) gr += A * de;
      Gr.col(ref_.beam[j]) += gr;
    }
  }
  z.J_reference = -M * Gr;
  z.J_current = -M * Gc;
  z.variance_reference = ref_.rangeVariances();
  z.variance_current = cur_.rangeVariances();
  rms_ = std::sqrt(chi2 / std::max(1, used - 3));
  const Eigen::MatrixXd Rz = z.J_reference * z.variance_reference.asDiagonal() * z.J_reference.transpose() +
                             z.J_current * z.variance_current.asDiagonal() * z.J_current.transpose();
  z.matching_noise = Rz * std::max(0.0, rms_ * rms_ - 1.0) * o.matching_noise_scale;
  return z;
}
}  // namespace sckf
