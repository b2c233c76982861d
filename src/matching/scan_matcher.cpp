#include "sckf_odometry/matching/scan_matcher.h"

#include <mrpt/poses/CPosePDF.h>
#include <mrpt/slam/CICP.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "sckf_odometry/matching/point_to_line.h"

namespace sckf {

namespace {

/// Points of the current scan with their nearest neighbours of the reference, at a displacement.
std::vector<Pair> nearestPairs(const PreparedScan& reference, const PreparedScan& current, const SE2& displacement,
                               double max_distance) {
  mrpt::maps::TMatchingParams params;
  params.maxDistForCorrespondence = static_cast<float>(max_distance);
  params.maxAngularDistForCorrespondence = 0.0F;
  params.onlyKeepTheClosest = true;
  mrpt::tfest::TMatchingPairList list;
  mrpt::maps::TMatchingExtraResults extra;
  reference.map.determineMatching2D(&current.map, {displacement.x, displacement.y, displacement.yaw}, list, params,
                                    extra);
  std::vector<Pair> pairs;
  pairs.reserve(list.size());
  for (const auto& pair : list) {
    pairs.push_back({static_cast<int>(pair.globalIdx), static_cast<int>(pair.localIdx)});
  }
  return pairs;
}

}  // namespace

std::string toString(MatchFailure failure) {
  switch (failure) {
    case MatchFailure::kNone:
      return "none";
    case MatchFailure::kTooFewPairs:
      return "too few pairs";
    case MatchFailure::kNoOverlap:
      return "no overlap";
    case MatchFailure::kDiverged:
      return "diverged";
    case MatchFailure::kNotObservable:
      return "not observable";
  }
  return "unknown";
}

ScanMatcher::ScanMatcher(const MatcherOptions& options) : options_(options) {}

Match ScanMatcher::match(const PreparedScan& reference, const PreparedScan& current,
                         const DisplacementPrediction& prediction) const {
  Match match;
  // MAP alignment: the prediction helps to decide which points belong together.
  Eigen::Matrix3d P = prediction.covariance;
  P.diagonal() +=
      Eigen::Vector3d(options_.prior_floor_translation, options_.prior_floor_translation, options_.prior_floor_yaw)
          .cwiseAbs2();
  const Eigen::Matrix3d prior = P.inverse();
  SE2 x = prediction.reference_from_current;

  if (options_.use_icp) {
    mrpt::slam::CICP icp;
    icp.options.maxIterations = 40;
    icp.options.corresponding_points_decimation = 1;
    icp.options.onlyUniqueRobust = true;
    icp.options.skip_cov_calculation = true;
    icp.options.skip_quality_calculation = true;
    icp.options.thresholdDist = options_.pair_distance_start;
    icp.options.smallestThresholdDist = options_.pair_distance;
    mrpt::poses::CPose2D guess(x.x, x.y, x.yaw);
    mrpt::slam::CICP::TReturnInfo info;
    const auto pdf = icp.Align(&reference.map, &current.map, guess, info);
    const auto mean = pdf->getMeanVal();
    x = SE2(mean.x(), mean.y(), mean.phi());
  }
  double distance = options_.use_icp ? options_.pair_distance * 2 : options_.pair_distance_start;
  PointToLine problem(reference, current);
  bool settled = false;
  for (int i = 0; i < options_.max_iterations; ++i) {
    problem.setPairs(nearestPairs(reference, current, x, distance), x, options_);
    if (problem.pairs().size() < static_cast<std::size_t>(options_.min_pairs)) {
      match.failure = MatchFailure::kTooFewPairs;
      return match;
    }
    const SE2 next = problem.step(x, &prior, prediction.reference_from_current);
    const Eigen::Vector3d change = error(next, x);
    x = next;
    const bool small = change.head<2>().norm() < 1e-4 && std::abs(change.z()) < 1e-4;
    if (small && distance <= options_.pair_distance) {
      settled = true;
      break;
    }
    if (small || i > 3) distance = std::max(options_.pair_distance, 0.6 * distance);
  }
  match.pairs = problem.pairs();
  match.overlap = static_cast<double>(match.pairs.size()) / static_cast<double>(current.size());
  (void)settled;
  if (match.overlap < options_.min_overlap) {
    match.failure = MatchFailure::kNoOverlap;
    return match;
  }
  match.displacement = problem.solve(x, options_);
  match.residual_rms = problem.residualRms();
  if (!match.displacement) {
    match.failure = MatchFailure::kNotObservable;
    return match;
  }
  const Eigen::Vector3d moved = error(match.displacement->reference_from_current, x);
  if (moved.head<2>().norm() > options_.max_refinement || std::abs(moved.z()) > options_.max_refinement) {
    match.displacement.reset();
    match.failure = MatchFailure::kDiverged;
  }
  return match;
}

}  // namespace sckf
