// The weighted least squares problem that pairs of points of two scans pose.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <vector>

#include "sckf_odometry/core/se2.h"
#include "sckf_odometry/matching/nearest_neighbours.h"
#include "sckf_odometry/matching/prepared_scan.h"

namespace sckf {

/// Which points belong together, and how well each pair is known.
struct PairOptions {
  double max_distance = 0.2;        ///< [m] two points farther apart are no pair
  double max_normal_angle = 1.05;   ///< [rad] nor are points on surfaces that are turned more against each other
  double normal_agreement = 0.2;    ///< [rad] pairs whose surfaces are turned by so much more than most weigh half
  double surface_roughness = 0.01;  ///< [m] std of a surface about the straight line fitted to it
  double point_std = 0.02;          ///< [m] std of a point on no straight surface, beside range noise and point spacing
  double robust_width = 3.0;        ///< a residual of this many std weighs half (Cauchy)
};

/// Cauchy's robust loss ρ(e) = c²/2 log(1 + e²/c²) of a residual in units of its std.
struct RobustKernel {
  double c = 3.0;

  double loss(double e) const { return 0.5 * c * c * std::log1p(e * e / (c * c)); }
  double weight(double e) const { return c * c / (c * c + e * e); }  ///< w = ρ′(e) / e
  double influence(double e) const { return e * weight(e); }         ///< ρ′(e)
  double slope(double e) const {                                     ///< ρ″(e) = w (2 w − 1)
    const double w = weight(e);
    return w * (2.0 * w - 1.0);
  }
};

/// e = nᵀ(C(φ) p + t − a) / σ: how far the current point p lies from the line through a with normal n of the reference
/// scan. A pair on a straight surface has one residual, across it; a pair on single points has two, along and across.
struct Residual {
  int reference = 0;
  int current = 0;
  Eigen::Vector2d normal;            ///< n
  Eigen::Vector2d anchor;            ///< a: centroid of the surface, or the point itself
  const Surface* surface = nullptr;  ///< null for single points
  double precision = 1.0;            ///< 1 / σ [1/m], since divisions take long
  double normal_variance = 0.0;      ///< of the direction of the surface's normal [rad²]
};

/// Everything that one residual has to tell at a displacement.
struct ResidualTerms {
  double e;                ///< the residual, in units of its std
  Eigen::Vector2d lever;   ///< C(φ) p
  Eigen::Vector2d offset;  ///< C(φ) p + t − a
  Eigen::Vector3d A;       ///< ∂e/∂(x, y, yaw)
};

/// Σ w (A, e) (A, e)ᵀ over residuals: all that least squares with weights need, in one sum because that is quicker.
class WeightedSquares {
 public:
  void add(double weight, const ResidualTerms& t) {
    const Eigen::Vector4d a(t.A.x(), t.A.y(), t.A.z(), t.e);
    sum_ += weight * a * a.transpose();
  }
  Eigen::Matrix3d information() const { return sum_.topLeftCorner<3, 3>(); }  ///< Σ w A Aᵀ
  Eigen::Vector3d gradient() const { return sum_.topRightCorner<3, 1>(); }    ///< Σ w e A
  double residuals() const { return sum_(3, 3); }                             ///< Σ w e²

 private:
  Eigen::Matrix4d sum_ = Eigen::Matrix4d::Zero();
};

/// The problem linearised at a displacement, its robust weights divided by the square of its scale.
struct NormalEquations {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  ///< Σ Aᵀ w A
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();     ///< Σ Aᵀ w e
  Eigen::Matrix3d spurious = Eigen::Matrix3d::Zero();     ///< the information that noise of the normals alone makes
  double lever = 0.0;                                     ///< rms distance of the points from base_link [m]
};

class AlignmentProblem {
 public:
  /// Pairs the points at the displacement, at most max_distance [m] apart, and weighs the pairs. Both scans must
  /// outlive the problem.
  AlignmentProblem(const PreparedScan& reference, const PreparedScan& current, const SE2& reference_from_current,
                   double max_distance, const PairOptions& options);
  /// The same of points that are paired already.
  AlignmentProblem(const PreparedScan& reference, const PreparedScan& current, const SE2& reference_from_current,
                   const std::vector<Pair>& neighbours, const PairOptions& options);

  const PreparedScan& reference() const { return reference_; }
  const PreparedScan& current() const { return current_; }
  const std::vector<Pair>& pairs() const { return pairs_; }
  const std::vector<Residual>& residuals() const { return residuals_; }
  const RobustKernel& kernel() const { return kernel_; }

  /// Robust std of the residuals, at least 1 and at most a bound: above 1 where the scans differ by more than noise.
  double scale() const { return scale_; }

  /// Share of the points of the current scan that have a partner.
  double overlap() const;

  /// Points of either scan without a partner that lie where the other scan has seen that nothing is.
  int contradictions() const;

  /// Share of the points with a partner among these and the contradictions: 1 where all that differs is what one of the
  /// scans cannot see. Where they do not belong together it is about a half.
  double agreement() const;

  ResidualTerms terms(const Residual& residual, const RigidMotion& reference_from_current) const;

  /// ∂A by the angle of the residual's normal.
  static Eigen::Vector3d derivativeByNormal(const Residual& residual, const ResidualTerms& terms);

  NormalEquations normalEquations(const SE2& reference_from_current) const;

  /// Mean loss of the points of the current scan: compares alignments with each other, and tells how well scans match:
  /// 0 where all lie on the reference, 3 where it has looked through all of them. A contradiction has a fixed price;
  /// what the other scan cannot see counts as the average of what it can, as otherwise places would be preferred that
  /// it sees.
  double misfit(const SE2& reference_from_current) const;

  /// The loss of all points that both scans see: no mean, and nothing is made of how few they are.
  double loss(const SE2& reference_from_current) const;

 private:
  void addSurfacePair(const Pair& pair, const RigidMotion& reference_from_current, const PairOptions& options);
  void addPointPair(const Pair& pair, const PairOptions& options);
  void weighByTurn(const RigidMotion& reference_from_current, const PairOptions& options);
  void fitKernel(const RigidMotion& reference_from_current, const PairOptions& options);
  int countContradictions() const;

  const PreparedScan& reference_;
  const PreparedScan& current_;
  SE2 paired_at_;
  std::vector<Pair> pairs_;
  std::vector<Residual> residuals_;
  RobustKernel kernel_;
  double scale_ = 1.0;
  mutable std::optional<int> contradictions_;  // counted when they are first asked for
};

// These are inline because most of the time of a match is spent in them.

inline ResidualTerms AlignmentProblem::terms(const Residual& residual,
                                             const RigidMotion& reference_from_current) const {
  ResidualTerms terms;
  terms.lever = reference_from_current.C * current_.points.point[static_cast<std::size_t>(residual.current)];
  terms.offset = terms.lever + reference_from_current.t - residual.anchor;
  terms.e = residual.precision * residual.normal.dot(terms.offset);
  terms.A << residual.normal, residual.normal.dot(quarterTurn(terms.lever));
  terms.A *= residual.precision;
  return terms;
}

inline Eigen::Vector3d AlignmentProblem::derivativeByNormal(const Residual& residual, const ResidualTerms& terms) {
  const Eigen::Vector2d tangent = quarterTurn(residual.normal);
  Eigen::Vector3d dA;
  dA << tangent, tangent.dot(quarterTurn(terms.lever));
  return residual.precision * dA;
}

}  // namespace sckf
