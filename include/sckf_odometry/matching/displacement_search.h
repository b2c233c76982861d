// Where two scans fall together: near the predicted displacement or, if they do not there, wherever they do.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/matching/alignment_problem.h"
#include "sckf_odometry/matching/decisive_place.h"
#include "sckf_odometry/matching/observability.h"
#include "sckf_odometry/matching/prepared_scan.h"
#include "sckf_odometry/matching/wide_search.h"

namespace sckf {

struct SearchOptions {
  double icp_pair_distance = 0.5;       ///< [m] CICP, if needed, pairs points up to this distance at its start
  int max_iterations = 15;              ///< of an alignment
  double prior_std_translation = 0.05;  ///< [m] added to the prediction's std of x and y, for the pairing of points
  double prior_std_yaw = 0.05;          ///< [rad] … and to its std of yaw
  double search_below_agreement = 0.8;  ///< more starts are tried if the scans contradict each other by more
  double search_yaw_step = 0.12;        ///< [rad] between the start yaws
  int search_yaw_steps = 4;             ///< start yaws to either side of the prediction
  double wide_search_below_agreement = 0.7;  ///< if they still do, wherever the scans may fall together
  WideSearchOptions wide_search;
  int min_pairs = 10;  ///< fewer points with a partner are "too few pairs"
  PairOptions pairs;
};

/// Where the search has come to.
struct Alignment {
  SE2 reference_from_current;
  double surprise = 0.0;  ///< squared Mahalanobis distance from the prediction
  AlignmentProblem problem;

  double misfit() const { return problem.misfit(reference_from_current); }
};

/// The search for one displacement. Scans and options have to outlive it.
class DisplacementSearch {
 public:
  DisplacementSearch(const PreparedScan& reference, const PreparedScan& current,
                     const DisplacementPrediction& prediction, const SearchOptions& options,
                     const ObservabilityOptions& observability);

  /// From the predicted displacement; if the scans do not fall together there, from where CICP finds that they do, from
  /// there and from the best of other yaws; and if they still do not by far, backwards, and from wherever they may, at
  /// first not too far from the prediction. Empty, as all below, if too few points have a partner.
  std::optional<Alignment> run() const;

  /// From the predicted displacement and nowhere else.
  std::optional<Alignment> runNear() const;

  /// The same of all other points.
  std::optional<Alignment> runNearWithout(const DecisivePlace& place) const;

  /// At the predicted displacement, as it is: points are paired once.
  std::optional<Alignment> there() const;

 private:
  SE2 icp(const SE2& start) const;
  SE2 bestOtherYaw() const;
  std::optional<Alignment> backwards() const;
  std::optional<Alignment> farAway(double price) const;
  std::optional<Alignment> anywhere() const;

  std::optional<Alignment> align(SE2 x, double distance) const;
  std::vector<Pair> pairsAt(const SE2& x, double distance, NearestNeighbours& neighbours) const;
  bool hasEnoughPairs(const AlignmentProblem& problem) const;
  Eigen::Vector3d mapStep(const NormalEquations& equations, const SE2& x) const;
  double surprise(const SE2& x) const;

  bool fits(const std::optional<Alignment>& alignment) const;
  bool agreesTooLittle(const Alignment& alignment) const;
  bool suspicious(const Alignment& alignment) const;

  const PreparedScan& reference_;
  const PreparedScan& current_;
  SE2 mean_;
  Eigen::Matrix3d prior_information_;
  const SearchOptions& options_;
  const ObservabilityOptions& observability_;
  DecisivePlace left_out_;  // whose points have no partner
};

}  // namespace sckf
