#include "sckf_odometry/experiments/line_matching.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/experiments/random_draws.h"

namespace sckf {

namespace {

constexpr double kBound = 3.0902;  // of a normal error, 99.8 % of the time

/// The wall as one scan shows it, in base_link: cos α · x + sin α · y = distance.
struct Line {
  double angle = 0.0;              // α [rad]
  double distance = 0.0;           // [m]
  Eigen::RowVectorXd angle_by;     // by each range [rad/m]; zero for beams that do not meet the wall
  Eigen::RowVectorXd distance_by;  // [1]

  Eigen::Vector2d normal() const { return {std::cos(angle), std::sin(angle)}; }
  Eigen::Vector2d along() const { return {-std::sin(angle), std::cos(angle)}; }
};

/// The line that makes the measured ranges most likely: r_i = distance / cos(θ_i − α), from where it really is.
Line fitLine(const Eigen::VectorXd& ranges, const std::vector<double>& bearings, const Line& truth) {
  constexpr int kIterations = 3;  // quadratic from a start that is as near as this
  Line line = truth;
  const auto n = static_cast<Eigen::Index>(bearings.size());
  Eigen::Matrix<double, Eigen::Dynamic, 2> A = Eigen::Matrix<double, Eigen::Dynamic, 2>::Zero(n, 2);
  Eigen::Matrix<double, 2, Eigen::Dynamic> solve;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Eigen::VectorXd residuals = Eigen::VectorXd::Zero(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      if (ranges(i) == 0.0) continue;
      const double angle = bearings[static_cast<std::size_t>(i)] - line.angle;
      A.row(i) << -line.distance * std::tan(angle) / std::cos(angle), 1.0 / std::cos(angle);
      residuals(i) = ranges(i) - line.distance / std::cos(angle);
    }
    solve = (A.transpose() * A).ldlt().solve(A.transpose());
    const Eigen::Vector2d step = solve * residuals;
    line.angle += step.x();
    line.distance += step.y();
  }
  line.angle_by = solve.row(0);
  line.distance_by = solve.row(1);
  return line;
}

Line scanLine(const LineMatchingOptions& options, const SE2& odom_from_base, RandomDraws& random) {
  Line truth;
  truth.angle = M_PI_2 - odom_from_base.yaw;  // the wall is ahead where the robot looks along y
  truth.distance = options.wall_distance - odom_from_base.y;
  std::vector<double> bearings;
  Eigen::VectorXd ranges = Eigen::VectorXd::Zero(options.beams);  // 0: the beam does not meet the wall
  for (int i = 0; i < options.beams; ++i) {
    bearings.push_back(2.0 * M_PI * i / options.beams);
    const double noise = options.range_std * random.gaussian();
    const double cosine = std::cos(bearings.back() - truth.angle);
    if (cosine * options.max_range > truth.distance) ranges(i) = truth.distance / cosine + noise;
  }
  return fitLine(ranges, bearings, truth);
}

/// What two views of one wall say: the rotation and, across the wall, the translation. V_o is where the reference scan
/// sees the wall; an error of this direction turns what is not seen into what is, which is why the translation along
/// the wall is needed for the Jacobian.
Displacement matchLines(const LineMatchingOptions& options, const Line& reference, const Line& current,
                        const SE2& predicted) {
  const double along = reference.along().dot(predicted.translation());
  const Eigen::Vector2d translation =
      (reference.distance - current.distance) * reference.normal() + along * reference.along();
  Displacement z;
  z.reference_from_current = SE2(translation.x(), translation.y(), reference.angle - current.angle);
  z.observable.resize(2, 3);
  z.observable << reference.normal().transpose(), 0.0, 0.0, 0.0, 1.0;
  z.J_reference.resize(2, options.beams);
  z.J_reference << reference.distance_by - along * reference.angle_by, reference.angle_by;
  z.J_current.resize(2, options.beams);
  z.J_current << -current.distance_by, -current.angle_by;
  z.variance_reference = Eigen::VectorXd::Constant(options.beams, std::pow(options.range_std, 2));
  z.variance_current = z.variance_reference;
  z.matching_noise = Eigen::Matrix2d::Zero();
  return z;
}

void add(const Eigen::Vector3d& e, const Eigen::Matrix3d& P, int runs, bool first_run, LineMatchingSample& sample) {
  const Eigen::Vector3d variance = P.diagonal();
  const Eigen::Vector3d std = variance.cwiseSqrt();
  if (first_run) {
    sample.error_of_first_run = e;
    sample.std = std;
  }
  sample.squared_error += e.cwiseAbs2() / runs;
  sample.variance += variance / runs;
  sample.normalized_square += e.cwiseAbs2().cwiseQuotient(variance) / runs;
  sample.inside += (e.array().abs() < kBound * std.array()).cast<double>().matrix() / runs;
  sample.nees += e.dot(P.llt().solve(e)) / runs;
}

/// Wheels and ranges are drawn from streams of their own, so that every method meets the same.
void run(const LineMatchingOptions& options, const std::string& method, int index,
         std::vector<LineMatchingSample>& samples) {
  RandomDraws random(options.seed + static_cast<std::uint64_t>(index));
  const SE2 moved(options.spacing, 0.0, options.spacing / options.radius);
  const double variance = std::pow(options.odometry_noise, 2) * options.spacing;
  const Eigen::Matrix3d Q = variance * Eigen::Matrix3d::Identity();
  SE2 truth(0.0, -options.radius, 0.0);
  const auto filter = makeFusionMethod(method, truth, Eigen::Matrix3d::Zero());
  const Eigen::VectorXd R = Eigen::VectorXd::Constant(options.beams, std::pow(options.range_std, 2));
  Line reference = scanLine(options, truth, random);
  filter->clone(R);
  for (LineMatchingSample& sample : samples) {
    const Eigen::Vector3d slip = std::sqrt(variance) * random.gaussian(3);
    filter->propagate({corrected(moved, slip), Q});
    truth = compose(truth, moved);
    const Line current = scanLine(options, truth, random);
    const SE2 predicted = filter->predictedDisplacement().reference_from_current;
    const Displacement z = matchLines(options, reference, current, predicted);
    filter->update(z, filter->innovation(z));
    filter->clone(R);
    reference = current;
    add(error(truth, filter->pose()), filter->covariance(), options.runs, index == 0, sample);
  }
}

}  // namespace

std::vector<LineMatchingSample> simulateLineMatching(const LineMatchingOptions& options, const std::string& method,
                                                     const std::function<void()>& tick) {
  const double way = 2.0 * M_PI * options.radius * options.laps;
  std::vector<LineMatchingSample> samples(static_cast<std::size_t>(std::lround(way / options.spacing)));
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i].way = options.spacing * static_cast<double>(i + 1);
  for (int i = 0; i < options.runs; ++i) {
    run(options, method, i, samples);
    tick();
  }
  return samples;
}

Eigen::Vector3d rootMeanSquare(const std::vector<LineMatchingSample>& samples) {
  const std::size_t half = samples.size() / 2;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = half; i < samples.size(); ++i) sum += samples[i].squared_error;
  return (sum / static_cast<double>(samples.size() - half)).cwiseSqrt();
}

}  // namespace sckf
