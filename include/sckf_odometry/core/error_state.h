// The covariance of an error state that is a list of parts, and of the range noise of scans that is considered with it.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <vector>

namespace sckf {

/// What an extended Kalman filter knows of its errors, N rows in parts that come and go: a pose, its clones, what is
/// not cloned. What a part is the error of, its owner knows. Range noise z̃ of a scan, M values with a diagonal
/// covariance, is never corrected and no part of the N; only its correlation with the state is kept.
class ErrorState {
 public:
  using Index = Eigen::Index;

  /// Some rows of the state. Valid until it is removed.
  struct Part {
    Index row = 0;
    Index size = 0;
  };

  /// The range noise of one scan. Valid until it is removed.
  using Ranges = std::size_t;

  /// r = Σ H x̃_part + Σ J z̃_scan + n, d rows: what is measured less what is expected, by the errors of both.
  struct Measurement {
    struct Term {
      Part part;
      Eigen::MatrixXd H;  ///< d × size
    };
    struct RangeTerm {
      Ranges scan;
      Eigen::MatrixXd J;  ///< d × M
    };
    Eigen::VectorXd residual;       ///< r, d
    std::vector<Term> terms;        ///< each part at most once
    std::vector<RangeTerm> ranges;  ///< each scan at most once
    Eigen::MatrixXd noise;          ///< covariance of n, d × d
  };

  /// A new part, independent of all others. Its covariance must be symmetric, positive semi-definite.
  Part add(const Eigen::MatrixXd& covariance);
  /// A new part with the same error as one there is.
  Part addCloneOf(Part part);
  void remove(Part part);

  Ranges addRanges(const Eigen::VectorXd& variances);
  void removeRanges(Ranges scan) { ranges_.erase(scan); }
  const Eigen::VectorXd& variances(Ranges scan) const { return ranges_.at(scan).variances; }

  /// x̃_part ← x̃_part + B x̃_by
  void move(Part part, const Eigen::MatrixXd& B, Part by);
  /// x̃_part ← x̃_part + w, where w is independent of all with covariance Q.
  void disturb(Part part, const Eigen::MatrixXd& Q);

  Eigen::MatrixXd covariance(Part a, Part b) const { return P_.block(a.row, b.row, a.size, b.size); }
  Eigen::MatrixXd covariance(Part part) const { return covariance(part, part); }

  /// How a measurement's r is correlated.
  struct Correlation {
    Eigen::MatrixXd state;       ///< E{x̃ rᵀ}, N × d
    Eigen::MatrixXd innovation;  ///< S = E{r rᵀ}, d × d
    /// K of a part, size × d, or of all rows, N × d.
    Eigen::MatrixXd gain(Part part) const { return gainOf(state.middleRows(part.row, part.size)); }
    Eigen::MatrixXd gain() const { return gainOf(state); }

   private:
    Eigen::MatrixXd gainOf(const Eigen::MatrixXd& rows) const;
  };
  Correlation correlate(const Measurement& measurement) const;

  /// A part is corrected by K r: best by K of the Correlation, but any other is allowed for in the covariance.
  struct Gain {
    Part part;
    Eigen::MatrixXd K;  ///< size × d
  };

  /// Schmidt update: some parts are corrected, all others and the ranges are considered, so that their covariance among
  /// themselves stays. Time of order N² + N Σq + q M, with the M ranges of the scans that it is by, and q ≤ 2N
  /// directions of each scan's noise that are correlated with the state. with_r: correlate(measurement).
  void update(const Measurement& measurement, const Correlation& with_r, const std::vector<Gain>& gains);

 private:
  /// E{z̃ x̃ᵀ} = D C: measurements correlate the noise of the ranges with the state by few directions of it.
  struct RangeNoise {
    Eigen::VectorXd variances;    // M
    Eigen::MatrixXd directions;   // D, M × q
    Eigen::MatrixXd coordinates;  // C, q × N
  };

  Part place(Index size);
  static Eigen::MatrixXd coordinates(const RangeNoise& noise, const Measurement& measurement);
  static void addDirections(RangeNoise& noise, const Eigen::MatrixXd& directions, const Eigen::MatrixXd& coordinates);

  Eigen::MatrixXd P_;       // N × N; rows of no part are zero
  std::vector<Part> gaps_;  // that were removed
  std::map<Ranges, RangeNoise> ranges_;
  Ranges next_ranges_ = 0;
};

}  // namespace sckf
