#include "sckf_odometry/experiments/one_dimension.h"

#include <cmath>
#include <stdexcept>

#include "sckf_odometry/core/displacement_covariance.h"
#include "sckf_odometry/experiments/random_draws.h"

namespace sckf {

namespace {

using Covariance = DisplacementCovariance<1>;
using Scalar = Covariance::Square;

/// The features ahead of the robot, numbered along the line, with the noise of their distances.
struct Scan {
  long first = 0;
  Eigen::VectorXd noise;

  long end() const { return first + noise.size(); }
};

Scan takeScan(const OneDimensionOptions& options, double position, double phase, RandomDraws& random) {
  const auto firstAhead = [&](double x) { return static_cast<long>(std::ceil((x - phase) * options.density)); };
  Scan scan;
  scan.first = firstAhead(position);
  scan.noise = options.range_std * random.gaussian(firstAhead(position + options.field) - scan.first);
  return scan;
}

/// (42): the mean of the differences over the features that both scans have.
Covariance::Measurement match(const OneDimensionOptions& options, const Scan& reference, const Scan& current) {
  const long shared = reference.end() - current.first;
  if (shared < 1) throw std::runtime_error("two scans share no feature: try a greater density, or a smaller field");
  const double weight = 1.0 / static_cast<double>(shared);
  Covariance::Measurement z;
  z.seen = Scalar::Identity();
  z.J_reference = Eigen::RowVectorXd::Zero(reference.noise.size());
  z.J_reference.rightCols(shared).setConstant(weight);
  z.J_current = Eigen::RowVectorXd::Zero(current.noise.size());
  z.J_current.leftCols(shared).setConstant(-weight);
  z.variance_current = Eigen::VectorXd::Constant(current.noise.size(), std::pow(options.range_std, 2));
  z.matching_noise = Scalar::Zero();
  return z;
}

struct Filter {
  explicit Filter(Covariance::Correlations correlations) : covariance(Scalar::Zero(), correlations) {}

  void clone(const Eigen::VectorXd& variances) { covariance.clone(Scalar::Identity(), Scalar::Identity(), variances); }
  double variance() const { return covariance.covariance(Scalar::Identity(), Scalar::Zero())(0); }

  Covariance covariance;
};

void run(const OneDimensionOptions& options, int steps, RandomDraws& random, OneDimensionPoint& sums) {
  const double phase = random.uniform(0.0, 1.0 / options.density);
  const auto variances = [&options](const Scan& scan) {
    return Eigen::VectorXd::Constant(scan.noise.size(), std::pow(options.range_std, 2)).eval();
  };
  Filter with(Covariance::Correlations::kKept);
  Filter without(Covariance::Correlations::kIgnored);
  double error = 0.0;
  Scan reference = takeScan(options, 0.0, phase, random);
  with.clone(variances(reference));
  without.clone(variances(reference));
  for (int step = 1; step <= steps; ++step) {
    const Scan current = takeScan(options, step * sums.spacing, phase, random);
    const Covariance::Measurement z = match(options, reference, current);
    error += (z.J_reference * reference.noise + z.J_current * current.noise)(0);
    for (Filter* filter : {&with, &without}) {
      filter->covariance.replace(z, Scalar::Identity());
      filter->clone(z.variance_current);
    }
    reference = current;
  }
  sums.with_correlations += with.variance() / options.runs;
  sums.without += without.variance() / options.runs;
  sums.squared_error += error * error / options.runs;
}

}  // namespace

double closedFormWithoutCorrelations(const OneDimensionOptions& options, double spacing) {
  const double shared = options.density * (options.field - spacing);
  return options.way / spacing * 2.0 * std::pow(options.range_std, 2) / shared;
}

double closedForm(const OneDimensionOptions& options, double spacing) {
  if (options.field <= 2.0 * spacing) return closedFormWithoutCorrelations(options, spacing);
  return 2.0 * std::pow(options.range_std, 2) * options.way / (options.density * std::pow(options.field - spacing, 2));
}

double firstDisplacementExcess(const OneDimensionOptions& options, double spacing) {
  if (options.field <= 2.0 * spacing) return 0.0;
  return 2.0 * std::pow(options.range_std, 2) * (options.field - 2.0 * spacing) /
         (options.density * std::pow(options.field - spacing, 2));
}

std::vector<OneDimensionPoint> simulateOneDimension(const OneDimensionOptions& options,
                                                    const std::vector<double>& spacings,
                                                    const std::function<void()>& tick) {
  std::vector<OneDimensionPoint> points;
  for (const double spacing : spacings) {
    const int steps = static_cast<int>(std::lround(options.way / spacing));
    OneDimensionPoint point;
    point.spacing = options.way / steps;
    for (int i = 0; i < options.runs; ++i) {
      RandomDraws random(options.seed + static_cast<std::uint64_t>(i));
      run(options, steps, random, point);
    }
    points.push_back(point);
    tick();
  }
  return points;
}

}  // namespace sckf
