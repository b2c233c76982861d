#include "sckf_odometry/experiments/complexity.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>

#include "sckf_odometry/core/multi_clone_filter.h"
#include "sckf_odometry/core/stochastic_cloning_filter.h"
#include "sckf_odometry/experiments/random_draws.h"
#include "sckf_odometry/pipeline/stopwatch.h"

namespace sckf {

namespace {

const OdometryIncrement kMoved{SE2(0.2, 0.0, 0.05), 1e-4 * Eigen::Matrix3d::Identity()};

/// The fastest of some repetitions, at least three and a twentieth of a second long [s].
double fastest(const std::function<void()>& prepare, const std::function<void()>& action) {
  const Stopwatch all;
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3 || all.seconds() < 0.05; ++i) {
    prepare();
    const Stopwatch one;
    action();
    best = std::min(best, one.seconds());
  }
  return best;
}

Displacement someDisplacement(int ranges, RandomDraws& random) {
  const double scale = 1.0 / ranges;  // as of least squares over so many
  Displacement z;
  z.reference_from_current = kMoved.before_from_after;
  z.variance_reference = Eigen::VectorXd::Constant(ranges, 0.02 * 0.02);
  z.variance_current = z.variance_reference;
  z.J_reference = Eigen::MatrixXd::NullaryExpr(3, ranges, [&] { return scale * random.gaussian(); });
  z.J_current = Eigen::MatrixXd::NullaryExpr(3, ranges, [&] { return scale * random.gaussian(); });
  z.matching_noise = 1e-6 * Eigen::Matrix3d::Identity();
  return z;
}

/// All the noise of the displacement in the one 3 × 3 matrix that a filter without correlations takes.
Displacement withoutRanges(const Displacement& z) {
  Displacement whole = z;
  whole.matching_noise = z.covariance();
  whole.J_reference.resize(3, 0);
  whole.J_current.resize(3, 0);
  whole.variance_reference.resize(0);
  whole.variance_current.resize(0);
  return whole;
}

double timeFilter(const Displacement& z, StochasticCloningFilter::Correlations correlations) {
  StochasticCloningFilter filter(SE2(), 0.01 * Eigen::Matrix3d::Identity(), correlations);
  filter.clone(z.variance_reference);
  return fastest([&] { filter.propagate(kMoved); },
                 [&] {
                   filter.update(z, filter.innovation(z));
                   filter.clone(z.variance_current);
                 });
}

double timeDense(const Displacement& z, RandomDraws& random) {
  const Eigen::Index n = 6 + z.J_reference.cols();
  Eigen::MatrixXd P = Eigen::MatrixXd::Zero(n, n);
  P.diagonal().setConstant(0.02 * 0.02);
  Eigen::MatrixXd H(3, n);
  H << Eigen::Matrix<double, 3, 6>::NullaryExpr([&] { return random.gaussian(); }), z.J_reference;
  return fastest([] {}, [&] { denseUpdate(H, z.matching_noise, P); });
}

/// With everything correlated with everything.
MultiCloneFilter filterOf(const StateSize& size, const Displacement& z, RandomDraws& random) {
  MultiCloneFilter filter(SE2(), 0.01 * Eigen::Matrix3d::Identity());
  for (int clone = 0; clone < size.clones; ++clone) {
    if (clone > 0) {
      filter.propagate(kMoved);
      filter.update(z, filter.innovation(z));
    }
    filter.clone(z.variance_current);
  }
  for (int landmark = 0; landmark < size.landmarks; ++landmark) {
    const SE2 place(random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0), random.uniform(-3.0, 3.0));
    filter.addLandmark({place, 1e-3 * Eigen::Matrix3d::Identity()});
  }
  return filter;
}

double timeUpdate(const StateSize& size, RandomDraws& random) {
  Displacement z = someDisplacement(size.ranges, random);
  MultiCloneFilter filter = filterOf(size, z, random);
  z.clone = static_cast<std::size_t>(size.clones) - 1;
  return fastest(
      [&] {
        filter.propagate(kMoved);
        z.reference_from_current = filter.predictedDisplacementFrom(z.clone).reference_from_current;
      },
      [&] { filter.update(z, filter.innovation(z)); });
}

}  // namespace

void denseUpdate(const Eigen::MatrixXd& H, const Eigen::MatrixXd& noise, Eigen::MatrixXd& P) {
  const Eigen::MatrixXd P_Ht = P * H.transpose();
  const Eigen::MatrixXd S = H * P_Ht + noise;
  const Eigen::MatrixXd K = S.llt().solve(P_Ht.transpose()).transpose();
  P.noalias() -= K * P_Ht.transpose();
}

std::vector<UpdateTimes> measureUpdates(const std::vector<int>& ranges, int max_dense_ranges,
                                        const std::function<void()>& tick) {
  using Correlations = StochasticCloningFilter::Correlations;
  std::vector<UpdateTimes> times;
  RandomDraws random(1);
  for (const int m : ranges) {
    const Displacement z = someDisplacement(m, random);
    UpdateTimes t;
    t.ranges = m;
    t.sckf = timeFilter(z, Correlations::kKept);
    t.sckf_nc = timeFilter(withoutRanges(z), Correlations::kIgnored);
    if (m <= max_dense_ranges) t.dense = timeDense(z, random);
    times.push_back(t);
    tick();
  }
  return times;
}

std::vector<double> measureUpdates(const std::vector<StateSize>& sizes, const std::function<void()>& tick) {
  std::vector<double> times;
  RandomDraws random(1);
  for (const StateSize& size : sizes) {
    times.push_back(timeUpdate(size, random));
    tick();
  }
  return times;
}

}  // namespace sckf
