// How long a scan takes, and how that grows with its number of ranges M. For a person to run, on a quiet machine:
//
//   build/devel/lib/sckf_odometry/benchmark_sckf
//
// In the second part "/M" says the number of ranges, "_BigO" the fit over them (N: M), "_RMS" by how much it misses.
#include <benchmark/benchmark.h>

#include <cmath>
#include <random>

#include "matching/simulated_world.h"
#include "sckf_odometry/core/odometry_model.h"
#include "sckf_odometry/core/stochastic_cloning_filter.h"
#include "sckf_odometry/matching/scan_matcher.h"

namespace sckf::test {
namespace {

const SE2 kDisplacement(0.4, -0.1, 0.2);

// ---- two scans of 361 beams in a room
// --------------------------------------------------------------------------------

struct TwoScans {
  TwoScans() {
    laser.noise = 0.01;
    std::mt19937_64 random(1);
    const LaserScan reference_scan = simulateScan(room(), SE2(), laser, &random);
    current_scan = simulateScan(room(), kDisplacement, laser, &random);
    reference = prepareScan(reference_scan, laser.base_from_laser, ScanOptions());
    current = prepareScan(current_scan, laser.base_from_laser, ScanOptions());
  }

  /// By wheels that are some centimetres and degrees off.
  static OdometryIncrement odometry() {
    return modelledIncrement(corrected(kDisplacement, {0.03, 0.02, -0.03}), OdometryNoise());
  }

  /// At the current scan, before it is matched.
  StochasticCloningFilter filter() const {
    StochasticCloningFilter filter(SE2(), Eigen::Matrix3d::Zero());
    filter.clone(reference->rangeVariances());
    filter.propagate(odometry());
    return filter;
  }

  SimulatedLaser laser;
  LaserScan current_scan;
  std::shared_ptr<const PreparedScan> reference;
  std::shared_ptr<const PreparedScan> current;
  ScanMatcher matcher{MatcherOptions()};
};

void prepareOneScan(benchmark::State& state) {
  const TwoScans scans;
  for (auto _ : state) {
    benchmark::DoNotOptimize(prepareScan(scans.current_scan, scans.laser.base_from_laser, ScanOptions()));
  }
}
BENCHMARK(prepareOneScan)->Unit(benchmark::kMillisecond);

void matchTwoScans(benchmark::State& state) {
  const TwoScans scans;
  const DisplacementPrediction prediction = scans.filter().predictedDisplacement();
  for (auto _ : state) benchmark::DoNotOptimize(scans.matcher.match(*scans.reference, *scans.current, prediction));
}
BENCHMARK(matchTwoScans)->Unit(benchmark::kMillisecond);

void updateByTwoScans(benchmark::State& state) {
  const TwoScans scans;
  const StochasticCloningFilter before = scans.filter();
  const Match match = scans.matcher.match(*scans.reference, *scans.current, before.predictedDisplacement());
  if (!match.displacement) {
    state.SkipWithError("the scans do not match");
    return;
  }
  for (auto _ : state) {
    StochasticCloningFilter filter = before;
    filter.update(*match.displacement, filter.innovation(*match.displacement));
    benchmark::DoNotOptimize(filter);
  }
}
BENCHMARK(updateByTwoScans)->Unit(benchmark::kMillisecond);

/// All that a scan is in for: prepared, predicted, matched, the filter updated, and the scan made the reference.
void wholeScan(benchmark::State& state) {
  const TwoScans scans;
  for (auto _ : state) {
    const auto current = prepareScan(scans.current_scan, scans.laser.base_from_laser, ScanOptions());
    StochasticCloningFilter filter = scans.filter();
    const Match match = scans.matcher.match(*scans.reference, *current, filter.predictedDisplacement());
    if (!match.displacement) {
      state.SkipWithError("the scans do not match");
      break;
    }
    filter.update(*match.displacement, filter.innovation(*match.displacement));
    filter.clone(current->rangeVariances());
    benchmark::DoNotOptimize(filter);
  }
}
BENCHMARK(wholeScan)->Unit(benchmark::kMillisecond)->Repetitions(9)->ReportAggregatesOnly(true);

// ---- the filter by the number of ranges
// ------------------------------------------------------------------------------

/// A displacement whose error comes from all of M ranges in either scan.
Displacement displacementWith(Eigen::Index M) {
  Displacement z;
  z.reference_from_current = SE2(0.1, 0.0, 0.05);
  z.J_reference = Eigen::MatrixXd::Random(3, M) / std::sqrt(static_cast<double>(M));
  z.J_current = Eigen::MatrixXd::Random(3, M) / std::sqrt(static_cast<double>(M));
  z.variance_reference = Eigen::VectorXd::Constant(M, 1e-4);
  z.variance_current = z.variance_reference;
  z.matching_noise = 1e-6 * Eigen::Matrix3d::Identity();
  return z;
}

const OdometryIncrement kIncrement = modelledIncrement(SE2(0.1, 0.0, 0.05), OdometryNoise());

/// A filter whose pose and reference are correlated with all of M ranges.
StochasticCloningFilter filterWith(const Displacement& z) {
  StochasticCloningFilter filter(SE2(), 1e-4 * Eigen::Matrix3d::Identity());
  for (int i = 0; i < 3; ++i) {
    filter.clone(z.variance_reference);
    filter.propagate(kIncrement);
    filter.update(z, filter.innovation(z));
  }
  return filter;
}

void propagate(benchmark::State& state) {
  StochasticCloningFilter filter = filterWith(displacementWith(state.range(0)));
  for (auto _ : state) filter.propagate(kIncrement);
  state.SetComplexityN(state.range(0));
}

void update(benchmark::State& state) {
  const Displacement z = displacementWith(state.range(0));
  StochasticCloningFilter filter = filterWith(z);
  for (auto _ : state) filter.update(z, filter.innovation(z));
  state.SetComplexityN(state.range(0));
}

/// One scan's worth of the paper's algorithm, every scan the next one's reference.
void propagateUpdateClone(benchmark::State& state) {
  const Displacement z = displacementWith(state.range(0));
  StochasticCloningFilter filter = filterWith(z);
  for (auto _ : state) {
    filter.propagate(kIncrement);
    filter.update(z, filter.innovation(z));
    filter.clone(z.variance_current);
  }
  state.SetComplexityN(state.range(0));
}

void numbersOfRanges(benchmark::internal::Benchmark* benchmark) {
  for (const int M : {100, 200, 500, 1000, 2000, 5000, 10000}) benchmark->Arg(M);
  benchmark->Unit(benchmark::kMicrosecond);
}
BENCHMARK(propagate)->Apply(numbersOfRanges)->Complexity(benchmark::o1);  // the ranges wait for the next update (14)
BENCHMARK(update)->Apply(numbersOfRanges)->Complexity(benchmark::oN);
BENCHMARK(propagateUpdateClone)->Apply(numbersOfRanges)->Complexity(benchmark::oN);

}  // namespace
}  // namespace sckf::test

BENCHMARK_MAIN();
