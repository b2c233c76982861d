// Two lasers on one robot, each with clones and range noise of its own: whether the covariance can be believed.
#include <gtest/gtest.h>

#include <vector>

#include "chi_squared_band.h"
#include "sckf_odometry/experiments/several_lasers.h"

namespace sckf {
namespace {

constexpr SeveralLasersOptions kOptions;
const ChiSquaredBand kBand(3, kOptions.runs);

SeveralLasersStatistics simulate(const std::vector<SimulatedLaserRate>& lasers) {
  return simulateSeveralLasers(lasers, kOptions);
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
  const double both = simulate({fastLaser(), slowLaser()}).squared_error.back();
  EXPECT_LT(both, 0.8 * simulate({fastLaser()}).squared_error.back());
  EXPECT_LT(both, 0.9 * simulate({slowLaser()}).squared_error.back());
}

}  // namespace
}  // namespace sckf
