#include "sckf_odometry/matching/scan_matcher.h"

#include <mrpt/poses/CPose2D.h>
#include <mrpt/poses/CPosePDF.h>
#include <mrpt/slam/CICP.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace sckf {

namespace {

/// Where the search for the displacement has come to.
struct Alignment {
  SE2 reference_from_current;
  double surprise = 0.0;  // squared Mahalanobis distance from the prior
  AlignmentProblem problem;

  double misfit() const { return problem.misfit(reference_from_current); }
};

/// The search for one displacement: scans, prior and options of a call of match().
class Search {
 public:
  Search(const PreparedScan& reference, const PreparedScan& current, const DisplacementPrediction& prediction,
         const MatcherOptions& options)
      : reference_(reference),
        current_(current),
        mean_(prediction.reference_from_current),
        prior_information_((prediction.covariance + priorFloor(options)).inverse()),
        options_(options) {}

  /// From the predicted displacement; if the scans do not fall together there, from where CICP finds that they do, from
  /// there and from the best of other yaws; and if they still do not by far, backwards, and from wherever they may, at
  /// first not too far from the prediction.
  std::optional<Alignment> run() const {
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

  /// From the predicted displacement and nowhere else.
  std::optional<Alignment> runNear() const { return align(mean_, options_.pairs.max_distance); }

  /// The same of all other points.
  std::optional<Alignment> runNearWithout(const DecisivePlace& place) const {
    Search others = *this;
    others.left_out_ = place;
    return others.runNear();
  }

  /// At the predicted displacement, as it is: points are paired once. Empty with too few pairs.
  std::optional<Alignment> there() const {
    AlignmentProblem problem(reference_, current_, mean_, options_.pairs.max_distance, options_.pairs);
    if (!hasEnoughPairs(problem)) return std::nullopt;
    return Alignment{mean_, 0.0, std::move(problem)};
  }

 private:
  static constexpr double kRough = 2.0;          // residuals of twice what noise explains
  static constexpr double kSurprise = 16.0;      // four sigma from the prior
  static constexpr double kGain = 0.3;           // misfit: for less the prior is not given up
  static constexpr double kAgreesBetter = 0.05;  // for less one place far from the prior is not left for another

  static Eigen::Matrix3d priorFloor(const MatcherOptions& options) {
    return Eigen::Vector3d(options.prior_std_translation, options.prior_std_translation, options.prior_std_yaw)
        .cwiseAbs2()
        .asDiagonal();
  }

  /// Of the yaws beside the prediction, the one at which the scans fall together best as they are.
  SE2 bestOtherYaw() const {
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
  std::optional<Alignment> backwards() const {
    Search search = *this;
    search.mean_ = SE2(-mean_.x, -mean_.y, mean_.yaw);
    std::optional<Alignment> found = search.runNear();
    if (found && search.suspicious(*found)) found.reset();
    return found;
  }

  /// Wherever the scans may fall together, if the wheels have slipped: they tell hardly more then than the bounds.
  /// price: see widelySearched().
  std::optional<Alignment> farAway(double price) const {
    const Eigen::Vector3d bounds(options_.wide_search.translation, options_.wide_search.translation,
                                 options_.wide_search.yaw);
    const Search search(reference_, current_, {mean_, bounds.cwiseAbs2().asDiagonal()}, options_);
    std::optional<Alignment> best;
    for (const SE2& place : widelySearched(reference_, current_, mean_, options_.wide_search, price)) {
      keepBetter(best, search.align(search.icp(place), options_.icp_pair_distance));
    }
    return best;
  }

  /// However far, as after a turn in which the wheels have told nothing and half of what was in view has gone out of
  /// it. Only if the scans fall together there as well as they would at a right prediction.
  std::optional<Alignment> anywhere() const {
    constexpr double kFallsTogether = 0.7;  // misfit: nine of ten right matches have less
    std::optional<Alignment> found = farAway(0.0);
    if (found && (suspicious(*found) || found->misfit() > kFallsTogether)) found.reset();
    return found;
  }

  SE2 icp(const SE2& start) const {
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
    const auto mean = icp.Align(&reference_.map, &current_.map, guess, info)->getMeanVal();
    return {mean.x(), mean.y(), mean.phi()};
  }

  /// The maximum of the posterior of surfaces and prior, that is nearest to a start: the prior decides which points
  /// belong together in directions that the scans hardly see, where CICP slides. Points are paired up to a distance at
  /// first, and up to max_distance in the end. Empty with too few pairs.
  std::optional<Alignment> align(SE2 x, double distance) const {
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

  std::vector<Pair> pairsAt(const SE2& x, double distance, NearestNeighbours& neighbours) const {
    std::vector<Pair> pairs = neighbours.pairs(RigidMotion(x), distance);
    if (left_out_.points.empty()) return pairs;
    const auto isLeftOut = [this](const Pair& pair) { return left_out_.contains(pair.current); };
    pairs.erase(std::remove_if(pairs.begin(), pairs.end(), isLeftOut), pairs.end());
    return pairs;
  }

  bool hasEnoughPairs(const AlignmentProblem& problem) const {
    return problem.pairs().size() >= static_cast<std::size_t>(options_.min_pairs);
  }

  double surprise(const SE2& x) const {
    const Eigen::Vector3d e = error(x, mean_);
    return e.dot(prior_information_ * e);
  }

  /// A step towards the maximum of the posterior, in which the scans have a say where they see and the prior elsewhere.
  Eigen::Vector3d mapStep(const NormalEquations& equations, const SE2& x) const {
    const ObservableDirections seen = observableDirections(equations, options_.estimation.observability);
    const auto& B = seen.basis;
    const auto& C = seen.coordinates;
    const Eigen::Matrix3d information =
        C.transpose() * (B.transpose() * equations.information * B) * C + prior_information_;
    const Eigen::Vector3d gradient =
        C.transpose() * (B.transpose() * equations.gradient) + prior_information_ * error(x, mean_);
    return -information.ldlt().solve(gradient);
  }

  /// Of the points and of the prior, to compare alignments with. Neighbouring points err alike, as on a wall that looks
  /// rough, so that a few tell as much as one: the prior counts so many times.
  static double cost(const Alignment& alignment) {
    constexpr double kAlike = 4.0;
    const auto points = static_cast<double>(alignment.problem.current().size());
    return points * alignment.misfit() + kAlike * 0.5 * alignment.surprise;
  }

  static void keepBetter(std::optional<Alignment>& best, std::optional<Alignment> other) {
    if (other && (!best || cost(*other) < cost(*best))) best.emplace(std::move(*other));
  }

  void takeIfBetter(std::optional<Alignment>& best, std::optional<Alignment> far) const {
    if (far && (!best || better(*far, *best))) best.emplace(std::move(*far));
  }

  /// Whether a place far from the prediction is better than what else there is: than one near the prediction if it
  /// explains clearly more of the points, than one that is far, too, if it agrees better as well.
  bool better(const Alignment& far, const Alignment& best) const {
    const bool near = best.surprise <= kSurprise;
    if (near) return far.misfit() + kGain < best.misfit();
    return far.misfit() < best.misfit() && far.problem.agreement() > best.problem.agreement() + kAgreesBetter;
  }

  bool fits(const std::optional<Alignment>& alignment) const {
    return alignment && alignment->surprise <= kSurprise &&
           alignment->problem.agreement() >= options_.wide_search_below_agreement;
  }

  bool agreesTooLittle(const Alignment& alignment) const {
    return alignment.problem.agreement() < options_.search_below_agreement;
  }

  bool suspicious(const Alignment& alignment) const {
    return agreesTooLittle(alignment) || alignment.problem.scale() > kRough || alignment.surprise > kSurprise;
  }

  const PreparedScan& reference_;
  const PreparedScan& current_;
  SE2 mean_;
  Eigen::Matrix3d prior_information_;
  const MatcherOptions& options_;
  DecisivePlace left_out_;  // whose points have no partner
};

bool ranAway(const SE2& estimated, const SE2& aligned, const MatcherOptions& options) {
  const Eigen::Vector3d moved = error(estimated, aligned);
  return !moved.allFinite() || moved.cwiseAbs().maxCoeff() > options.max_refinement;
}

/// The match that an alignment comes to, or why it comes to none.
Match concluded(const std::optional<Alignment>& aligned, const MatcherOptions& options) {
  Match match;
  if (!aligned) {
    match.failure = MatchFailure::kTooFewPairs;
    return match;
  }
  const SE2& start = aligned->reference_from_current;
  std::optional<DisplacementEstimate> estimate = estimateDisplacement(aligned->problem, start, options.estimation);
  match.pairs = aligned->problem.pairs();
  match.overlap = aligned->problem.overlap();
  match.agreement = aligned->problem.agreement();
  match.misfit = aligned->misfit();
  if (estimate) {
    match.decisive = std::move(estimate->decisive);
    match.range_offset = estimate->range_offset;
    match.sweep_duration = estimate->sweep_duration;
  }
  if (match.overlap < options.min_overlap) {
    match.failure = MatchFailure::kNoOverlap;
  } else if (match.agreement < options.min_agreement) {
    match.failure = MatchFailure::kContradiction;
  } else if (!estimate) {
    match.failure = MatchFailure::kNotObservable;
  } else if (ranAway(estimate->displacement.reference_from_current, start, options)) {
    match.failure = MatchFailure::kDiverged;
  } else {
    match.displacement.emplace(std::move(estimate->displacement));
  }
  return match;
}

/// The squared Mahalanobis distance of a match from its prediction. What its decisive place may be off by does not
/// count: whether it is off is what is asked.
double contradiction(const Match& match, const DisplacementPrediction& prediction, const EstimationOptions& options) {
  const Displacement& z = *match.displacement;
  const Displacement::MatrixDD covariance = z.observable * prediction.covariance * z.observable.transpose() +
                                            z.covariance() - placeNoise(z, match.decisive, options.place_std);
  const Eigen::VectorXd e = z.observable * error(z.reference_from_current, prediction.reference_from_current);
  return e.dot(covariance.ldlt().solve(e));
}

/// The match without the place that decides most of it, if that place contradicts the prediction and nothing else does:
/// rather than the wheels have slipped, somebody walks there. Where they have, what else is seen contradicts them, too.
std::optional<Match> withoutMovedPlace(const Match& match, const Search& search,
                                       const DisplacementPrediction& prediction, const MatcherOptions& options) {
  constexpr double kContradicts = 4.0;  // two sigma: not much is lost where the place is left out for nothing
  const double min_share = options.moved_place_min_share;
  if (min_share <= 0.0 || !match.displacement || match.decisive.share() < min_share) return std::nullopt;
  if (contradiction(match, prediction, options.estimation) <= kContradicts) return std::nullopt;
  Match others = concluded(search.runNearWithout(match.decisive), options);
  if (!others.displacement || contradiction(others, prediction, options.estimation) > kContradicts) return std::nullopt;
  others.place_left_out = true;
  return others;
}

/// The match refined by one of the scans with their roles exchanged, paired where they lie by now, if there is one
/// close to it.
Match refinedByReturn(Match match, const PreparedScan& reference, const PreparedScan& current,
                      const MatcherOptions& options) {
  constexpr double kFarthest = 0.1;  // [m]
  constexpr double kTurned = 0.05;   // [rad]
  if (!options.both_ways || !match.displacement || match.displacement->dimension() != 3) return match;
  const SE2& there = match.displacement->reference_from_current;
  const Match back = concluded(Search(current, reference, {inverse(there)}, options).there(), options);
  if (!back.displacement || back.displacement->dimension() != 3) return match;
  const Eigen::Vector3d e = error(inverse(back.displacement->reference_from_current), there);
  if (e.head<2>().norm() > kFarthest || std::abs(e.z()) > kTurned) return match;
  match.displacement = meanOfBothWays(*match.displacement, *back.displacement);
  return match;
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
    case MatchFailure::kContradiction:
      return "scans contradict each other";
    case MatchFailure::kDiverged:
      return "diverged";
    case MatchFailure::kNotObservable:
      return "not observable";
  }
  return "unknown";
}

Match ScanMatcher::match(const PreparedScan& reference, const PreparedScan& current,
                         const DisplacementPrediction& prediction) const {
  const Search search(reference, current, prediction, options_);
  Match match = concluded(search.run(), options_);
  if (std::optional<Match> others = withoutMovedPlace(match, search, prediction, options_)) return *std::move(others);
  return refinedByReturn(std::move(match), reference, current, options_);
}

Match ScanMatcher::matchNear(const PreparedScan& reference, const PreparedScan& current,
                             const DisplacementPrediction& prediction) const {
  const std::optional<Alignment> aligned = Search(reference, current, prediction, options_).runNear();
  return refinedByReturn(concluded(aligned, options_), reference, current, options_);
}

bool ScanMatcher::refutes(const PreparedScan& reference, const PreparedScan& current,
                          const SE2& reference_from_current) const {
  constexpr double kHardlyAny = 0.1;  // agreement
  constexpr double kMany = 0.25;      // of the points of one scan
  const AlignmentProblem there(reference, current, reference_from_current, options_.pairs.max_distance, options_.pairs);
  return there.agreement() < kHardlyAny && there.contradictions() > kMany * static_cast<double>(current.size());
}

}  // namespace sckf
