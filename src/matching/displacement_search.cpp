#include "sckf_odometry/matching/displacement_search.h"

#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/poses/CPose2D.h>
#include <mrpt/poses/CPosePDF.h>
#include <mrpt/slam/CICP.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <limits>
#include <utility>

namespace sckf {

namespace {

constexpr double kSurprise = 16.0;  // four sigma from the prediction

Eigen::Matrix3d priorFloor(const SearchOptions& options) {
  return Eigen::Vector3d(options.prior_std_translation, options.prior_std_translation, options.prior_std_yaw)
      .cwiseAbs2()
      .asDiagonal();
}

/// Of the points and of the prediction, to compare alignments with. Neighbouring points err alike, as on a wall that
/// looks rough, so that a few tell as much as one: the prediction counts so many times.
double cost(const Alignment& alignment) {
  constexpr double kAlike = 4.0;
  const auto points = static_cast<double>(alignment.problem.current().size());
  return points * alignment.misfit() + kAlike * 0.5 * alignment.surprise;
}

void keepBetter(std::optional<Alignment>& best, std::optional<Alignment> other) {
  if (other && (!best || cost(*other) < cost(*best))) best.emplace(std::move(*other));
}

/// Whether a place far from the prediction is better than what else there is: than one near the prediction if it
/// explains clearly more of the points, than one that is far, too, if it agrees better as well.
bool better(const Alignment& far, const Alignment& best) {
  constexpr double kGain = 0.3;           // misfit: for less the prediction is not given up
  constexpr double kAgreesBetter = 0.05;  // for less one place far from it is not left for another
  const bool near = best.surprise <= kSurprise;
  if (near) return far.misfit() + kGain < best.misfit();
  return far.misfit() < best.misfit() && far.problem.agreement() > best.problem.agreement() + kAgreesBetter;
}

void takeIfBetter(std::optional<Alignment>& best, std::optional<Alignment> far) {
  if (far && (!best || better(*far, *best))) best.emplace(std::move(*far));
}

}  // namespace

DisplacementSearch::DisplacementSearch(const PreparedScan& reference, const PreparedScan& current,
                                       const DisplacementPrediction& prediction, const SearchOptions& options,
                                       const ObservabilityOptions& observability)
    : reference_(reference),
      current_(current),
      mean_(prediction.reference_from_current),
      prior_information_((prediction.covariance + priorFloor(options)).inverse()),
      options_(options),
      observability_(observability) {}

std::optional<Alignment> DisplacementSearch::run() const {
  std::optional<Alignment> best = runNear();
  if (best && !suspicious(*best)) return best;
  keepBetter(best, align(icp(mean_), options_.icp_pair_distance));
  if (best && !suspicious(*best)) return best;
  if (options_.search_yaw_steps > 0) keepBetter(best, align(icp(bestOtherYaw()), options_.icp_pair_distance));
  if (options_.wide_search.yaw <= 0.0 || fits(best)) return best;
  takeIfBetter(best, backwards());
  if (!fits(best)) takeIfBetter(best, farAway(kPriceOfDistance));
  if (!best || agreesTooLittle(*best)) takeIfBetter(best, anywhere());
  return best;
}

std::optional<Alignment> DisplacementSearch::runNear() const { return align(mean_, options_.pairs.max_distance); }

std::optional<Alignment> DisplacementSearch::runNearWithout(const DecisivePlace& place) const {
  DisplacementSearch others = *this;
  others.left_out_ = place;
  return others.runNear();
}

std::optional<Alignment> DisplacementSearch::there() const {
  AlignmentProblem problem(reference_, current_, mean_, options_.pairs.max_distance, options_.pairs);
  if (!hasEnoughPairs(problem)) return std::nullopt;
  return Alignment{mean_, 0.0, std::move(problem)};
}

// ---- from where

SE2 DisplacementSearch::icp(const SE2& start) const {
  constexpr double kNearEnough = 2e-3;  // [m, rad] a step so small is its last: what comes after it is finer
  mrpt::slam::CICP icp;
  icp.options.corresponding_points_decimation = 1;
  icp.options.onlyUniqueRobust = true;
  icp.options.skip_cov_calculation = true;
  icp.options.skip_quality_calculation = true;
  icp.options.thresholdDist = options_.icp_pair_distance;
  icp.options.smallestThresholdDist = options_.pairs.max_distance;
  icp.options.minAbsStep_trans = icp.options.minAbsStep_rot = kNearEnough;
  mrpt::slam::CICP::TReturnInfo info;
  const mrpt::poses::CPose2D guess(start.x, start.y, start.yaw);
  const auto mean = icp.Align(reference_.map.get(), current_.map.get(), guess, info)->getMeanVal();
  return {mean.x(), mean.y(), mean.phi()};
}

/// Of the yaws beside the prediction, the one at which the scans fall together best as they are.
SE2 DisplacementSearch::bestOtherYaw() const {
  SE2 best;
  double least = std::numeric_limits<double>::infinity();
  for (int k = -options_.search_yaw_steps; k <= options_.search_yaw_steps; ++k) {
    if (k == 0) continue;
    const SE2 x(mean_.x, mean_.y, mean_.yaw + k * options_.search_yaw_step);
    const double misfit =
        AlignmentProblem(reference_, current_, x, options_.icp_pair_distance, options_.pairs).misfit(x);
    if (misfit < least) {
      least = misfit;
      best = x;
    }
  }
  return best;
}

/// Where the wheels tell how far the robot went and not which way: of some the encoders lose the sign when it
/// reverses. Only if the scans fall together there at once, as well as they would at a right prediction.
std::optional<Alignment> DisplacementSearch::backwards() const {
  DisplacementSearch search = *this;
  search.mean_ = SE2(-mean_.x, -mean_.y, mean_.yaw);
  std::optional<Alignment> found = search.runNear();
  if (found && search.suspicious(*found)) found.reset();
  return found;
}

/// Wherever the scans may fall together, if the wheels have slipped: they tell hardly more then than the bounds.
/// price: see widelySearched().
std::optional<Alignment> DisplacementSearch::farAway(double price) const {
  const Eigen::Vector3d bounds(options_.wide_search.translation, options_.wide_search.translation,
                               options_.wide_search.yaw);
  const DisplacementSearch search(reference_, current_, {mean_, bounds.cwiseAbs2().asDiagonal()}, options_,
                                  observability_);
  std::optional<Alignment> best;
  for (const SE2& place : widelySearched(reference_, current_, mean_, options_.wide_search, price)) {
    keepBetter(best, search.align(search.icp(place), options_.icp_pair_distance));
  }
  return best;
}

/// However far, as after a turn in which the wheels have told nothing and half of what was in view has gone out of
/// it. Only if the scans fall together there as well as they would at a right prediction.
std::optional<Alignment> DisplacementSearch::anywhere() const {
  constexpr double kFallsTogether = 0.7;  // misfit: nine of ten right matches have less
  std::optional<Alignment> found = farAway(0.0);
  if (found && (suspicious(*found) || found->misfit() > kFallsTogether)) found.reset();
  return found;
}

// ---- from there on

/// The maximum of the posterior of surfaces and prediction, that is nearest to a start: the prediction decides which
/// points belong together in directions that the scans hardly see, where CICP slides. Points are paired up to a
/// distance at first, and up to max_distance in the end. Empty with too few pairs.
std::optional<Alignment> DisplacementSearch::align(SE2 x, double distance) const {
  constexpr double kSettled = 1e-3;  // [m, rad] points do not change partners for less; the estimate finds the rest
  NearestNeighbours neighbours(reference_, current_);
  for (int i = 1;; ++i) {
    AlignmentProblem problem(reference_, current_, x, pairsAt(x, distance, neighbours), options_.pairs);
    if (!hasEnoughPairs(problem)) return std::nullopt;
    const Eigen::Vector3d step = mapStep(problem.normalEquations(x), x);
    x = corrected(x, step);
    const bool settled = step.cwiseAbs().maxCoeff() < kSettled || i >= options_.max_iterations;
    if (settled && distance <= options_.pairs.max_distance) {
      return Alignment{x, surprise(x), std::move(problem)};
    }
    distance = std::max(options_.pairs.max_distance, 0.6 * distance);
  }
}

std::vector<Pair> DisplacementSearch::pairsAt(const SE2& x, double distance, NearestNeighbours& neighbours) const {
  std::vector<Pair> pairs = neighbours.pairs(RigidMotion(x), distance);
  if (left_out_.points.empty()) return pairs;
  const auto isLeftOut = [this](const Pair& pair) { return left_out_.contains(pair.current); };
  pairs.erase(std::remove_if(pairs.begin(), pairs.end(), isLeftOut), pairs.end());
  return pairs;
}

bool DisplacementSearch::hasEnoughPairs(const AlignmentProblem& problem) const {
  return problem.pairs().size() >= static_cast<std::size_t>(options_.min_pairs);
}

/// A step towards the maximum of the posterior, in which the scans have a say where they see and the prediction
/// elsewhere.
Eigen::Vector3d DisplacementSearch::mapStep(const NormalEquations& equations, const SE2& x) const {
  const ObservableDirections seen = observableDirections(equations, observability_);
  const auto& B = seen.basis;
  const auto& C = seen.coordinates;
  const Eigen::Matrix3d information =
      C.transpose() * (B.transpose() * equations.information * B) * C + prior_information_;
  const Eigen::Vector3d gradient =
      C.transpose() * (B.transpose() * equations.gradient) + prior_information_ * error(x, mean_);
  return -information.ldlt().solve(gradient);
}

double DisplacementSearch::surprise(const SE2& x) const {
  const Eigen::Vector3d e = error(x, mean_);
  return e.dot(prior_information_ * e);
}

// ---- whether it is right

bool DisplacementSearch::fits(const std::optional<Alignment>& alignment) const {
  return alignment && alignment->surprise <= kSurprise &&
         alignment->problem.agreement() >= options_.wide_search_below_agreement;
}

bool DisplacementSearch::agreesTooLittle(const Alignment& alignment) const {
  return alignment.problem.agreement() < options_.search_below_agreement;
}

bool DisplacementSearch::suspicious(const Alignment& alignment) const {
  constexpr double kRough = 2.0;  // residuals of twice what noise explains
  return agreesTooLittle(alignment) || alignment.problem.scale() > kRough || alignment.surprise > kSurprise;
}

}  // namespace sckf
