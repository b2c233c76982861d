// Two lasers on one robot, each with clones and range noise of its own: whether the covariance can be believed.
#include <gtest/gtest.h>

#include <numeric>
#include <vector>

#include "core/chi_squared_band.h"
#include "sckf_odometry/experiments/several_lasers.h"

namespace sckf {
namespace {

constexpr SeveralLasersOptions kOptions;
const ChiSquaredBand kBand(3, kOptions.runs);

SeveralLasersStatistics simulate(const std::vector<SimulatedLaserRate>& lasers) {
  return simulateSeveralLasers(lasers, kOptions);
}

/// Mean over the way [m²].
double squaredError(const std::vector<SimulatedLaserRate>& lasers) {
  const std::vector<double> errors = simulate(lasers).squared_error;
  return std::accumulate(errors.begin(), errors.end(), 0.0) / static_cast<double>(errors.size());
}

TEST(SeveralLasers, AreConsistent) {
  expectInBand(simulate({fastLaser(), slowLaser()}).nees, kBand, "NEES");
  expectInBand(simulate({slowLaser(), fastLaser(), fastLaser()}).nees, kBand, "NEES of three");
}

TEST(SeveralLasers, OneThatFailsLeavesTheOthers) {
  SimulatedLaserRate dies = slowLaser();
  dies.until = 30;
  expectInBand(simulate({fastLaser(), dies}).nees, kBand, "NEES");
}

TEST(SeveralLasers, AreMoreAccurateThanEach) {
  const double both = squaredError({fastLaser(), slowLaser()});
  EXPECT_LT(both, 0.8 * squaredError({fastLaser()}));
  EXPECT_LT(both, 0.9 * squaredError({slowLaser()}));
}

}  // namespace
}  // namespace sckf
