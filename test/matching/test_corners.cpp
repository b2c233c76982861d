// Corners of scans: hand values, derivatives, covariance, and what is none.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "core/matrix_matchers.h"
#include "matching/feature_scans.h"
#include "sckf_odometry/matching/corners.h"

namespace sckf::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

CornerOptions exact() {
  CornerOptions options;
  options.std_position = options.std_yaw = 0.0;
  return options;
}

/// Two walls that end at `corner` (in base_link), along two directions.
World twoWalls(const Eigen::Vector2d& corner, double one, double other, double length = 2.0) {
  const auto end = [&](double yaw) -> Eigen::Vector2d {
    return corner + length * Eigen::Vector2d(std::cos(yaw), std::sin(yaw));
  };
  return {{corner, end(one)}, {corner, end(other)}};
}

//        ----------+        y
//                  |        |
//        robot     |        +-- x
//                  |
TEST(Corners, AnInnerCornerLooksAtTheRobot) {
  const auto corners = findCorners(scanOf(twoWalls({3.0, 2.0}, M_PI, -M_PI_2)), CornerOptions());
  ASSERT_EQ(corners.size(), 1U);
  EXPECT_TRUE(matricesNear(corners[0].base_from_corner.vector(), Vector3d(3.0, 2.0, -0.75 * M_PI), 1e-4));
  EXPECT_NEAR(corners[0].angle, M_PI_2, 1e-4);
}

//                  +------
//        robot     |
//                  |
TEST(Corners, AnOuterCornerLooksAway) {
  // Seen from where both walls are in view: the robot is above the one and left of the other.
  const auto corners = findCorners(scanOf(twoWalls({2.0, -2.0}, 0.0, -M_PI_2)), CornerOptions());
  ASSERT_EQ(corners.size(), 1U);
  EXPECT_TRUE(matricesNear(corners[0].base_from_corner.vector(), Vector3d(2.0, -2.0, -M_PI_4), 1e-4));
}

TEST(Corners, ItsPointsAreThoseOfBothWallsUpToTheirLength) {
  const PreparedScan scan = scanOf(twoWalls({3.0, 2.0}, M_PI, -M_PI_2));
  CornerOptions options;
  options.max_length = 1.0;
  const auto corners = findCorners(scan, options);
  ASSERT_EQ(corners.size(), 1U);
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const double distance = (scan.points.point[i] - Eigen::Vector2d(3.0, 2.0)).norm();
    const int k = static_cast<int>(i);
    const bool is_its_own = corners[0].first <= k && k <= corners[0].last;
    if (distance < 0.95) {
      EXPECT_TRUE(is_its_own) << distance;
    } else if (distance > 1.05) {
      EXPECT_FALSE(is_its_own) << distance;
    }
  }
}

TEST(Corners, OfARoomAllAreFoundAndNoneSharesAPoint) {
  const World world = closedPolygon({{-3, -2}, {4, -2}, {4, 3}, {-3, 3}});
  std::mt19937_64 random(7);
  const auto corners = findCorners(prepare(simulateScan(world, SE2(), fineLaser(0.01), &random)), CornerOptions());
  ASSERT_EQ(corners.size(), 4U);
  const double expected[4][3] = {{-3, -2, M_PI_4}, {4, -2, 0.75 * M_PI}, {4, 3, -0.75 * M_PI}, {-3, 3, -M_PI_4}};
  for (std::size_t i = 0; i < 4; ++i) {
    const Vector3d e = error(corners[i].base_from_corner, SE2(expected[i][0], expected[i][1], expected[i][2]));
    EXPECT_LT(e.cwiseAbs().maxCoeff(), 0.04) << "corner " << i << ": " << e.transpose();
    if (i > 0) {
      EXPECT_GT(corners[i].first, corners[i - 1].last);
    }
  }
}

TEST(Corners, WhatIsNone) {
  const auto count = [](const World& world, const CornerOptions& options = {}) {
    return findCorners(scanOf(world), options).size();
  };
  EXPECT_EQ(count({{{3.0, -3.0}, {3.0, 3.0}}}), 0U) << "a wall";
  EXPECT_EQ(count(twoWalls({3.0, 0.0}, M_PI_2 + 0.2, -M_PI_2 - 0.2)), 0U) << "hardly a bend";
  EXPECT_EQ(count(twoWalls({3.0, 2.0}, M_PI, -M_PI_2, 0.28)), 0U) << "short walls";
  CornerOptions patient;
  patient.min_length = 0.15;
  EXPECT_EQ(count(twoWalls({3.0, 2.0}, M_PI, -M_PI_2, 0.28), patient), 1U) << "unless short ones are allowed";
  // A wall that ends before another, which it hides: two depths, and no corner.
  EXPECT_EQ(count({{{2.0, -2.0}, {2.0, 0.0}}, {{4.0, -2.0}, {4.0, 2.0}}}), 0U) << "an occlusion";
  // Both depths near each other, as far as the beams tell connected, but the lines meet elsewhere.
  EXPECT_EQ(count({{{2.0, -2.0}, {2.0, 0.0}}, {{2.6, 0.0}, {4.0, 1.4}}}), 0U) << "walls that do not meet";
  EXPECT_EQ(count(roundWall(3.0)), 0U) << "a round wall";
}

TEST(Corners, TheDerivativesByTheRanges) {
  // A little noise, so that there is one place where the walls are split best, whatever range changes.
  std::mt19937_64 random(12);
  const LaserScan scan = simulateScan(twoWalls({3.0, 1.0}, 2.6, -1.8, 1.2), SE2(), fineLaser(0.005), &random);
  const PreparedScan prepared = prepare(scan);
  const auto corners = findCorners(prepared, CornerOptions());
  ASSERT_EQ(corners.size(), 1U);
  const Corner& corner = corners[0];
  constexpr double kStep = 3e-4;  // ranges are floats
  for (int i = corner.first; i <= corner.last; ++i) {
    const auto beam = static_cast<std::size_t>(prepared.points.beam[static_cast<std::size_t>(i)]);
    const auto at = [&](double step) {
      LaserScan changed = scan;
      changed.ranges[beam] += static_cast<float>(step);
      const auto found = findCorners(prepare(changed), CornerOptions());
      EXPECT_EQ(found.size(), 1U);
      return found.empty() ? SE2() : found[0].base_from_corner;
    };
    const Vector3d numerical = error(at(kStep), at(-kStep)) / (2.0 * kStep);
    EXPECT_TRUE(matricesNear(corner.by_range.col(i - corner.first), numerical, 2e-3)) << "point " << i;
  }
}

TEST(Corners, TheCovarianceIsThatOfTheErrors) {
  const World world = twoWalls({3.0, 1.0}, 2.6, -1.8, 1.2);
  std::mt19937_64 random(11);
  Matrix3d sampled = Matrix3d::Zero();
  Matrix3d claimed = Matrix3d::Zero();
  Vector3d mean = Vector3d::Zero();
  constexpr int kDraws = 2000;
  int found = 0;
  for (int i = 0; i < kDraws; ++i) {
    PreparedScan scan = prepare(simulateScan(world, SE2(), fineLaser(0.02), &random));
    scan.range_noise = 0.02;
    const auto corners = findCorners(scan, exact());
    if (corners.size() != 1) continue;
    ++found;
    const Vector3d e = error(corners[0].base_from_corner, SE2(3.0, 1.0, 0.4 - M_PI));
    mean += e;
    sampled += e * e.transpose();
    claimed += corners[0].covariance;
  }
  ASSERT_GT(found, 0.98 * kDraws);
  mean /= found;
  sampled /= found;
  claimed /= found;
  EXPECT_LT(mean.cwiseAbs().cwiseQuotient(claimed.diagonal().cwiseSqrt()).maxCoeff(), 0.2) << mean.transpose();
  for (Eigen::Index i = 0; i < 3; ++i) {
    EXPECT_NEAR(claimed(i, i) / sampled(i, i), 1.0, 0.15) << i << "\n" << claimed << "\n\n" << sampled;
    for (Eigen::Index j = 0; j < i; ++j) {
      EXPECT_NEAR(claimed(i, j), sampled(i, j), 0.15 * std::sqrt(sampled(i, i) * sampled(j, j)));
    }
  }
}

TEST(Corners, WhatWallsAreNotIsAdded) {
  const PreparedScan scan = scanOf(twoWalls({3.0, 2.0}, M_PI, -M_PI_2));
  CornerOptions options;
  options.std_position = 0.3;
  options.std_yaw = 0.2;
  const Matrix3d more = findCorners(scan, options)[0].covariance - findCorners(scan, exact())[0].covariance;
  EXPECT_TRUE(matricesNear(more, Matrix3d(Vector3d(0.09, 0.09, 0.04).asDiagonal()), 1e-9));
}

TEST(Corners, WhatIsSetAsideHasNoPartInWhatIsLeft) {
  const LaserScan scan = simulateScan(room(), SE2(), fineLaser());
  const PreparedScan whole = prepare(scan);
  std::vector<bool> aside(whole.size(), false);
  for (std::size_t i = 100; i < 200; ++i) aside[i] = true;
  const auto rest = setAside(whole, aside, SurfaceOptions());
  ASSERT_EQ(rest->size(), whole.size() - 100);
  EXPECT_EQ(rest->set_aside.size(), 100U);
  EXPECT_EQ(rest->beams, whole.beams);
  EXPECT_EQ(rest->range_noise, whole.range_noise);
  // Ranges of theirs that are changed change nothing.
  LaserScan changed = scan;
  for (std::size_t i = 100; i < 200; ++i) {
    changed.ranges[static_cast<std::size_t>(whole.points.beam[i])] += 0.5F;
  }
  PreparedScan other = prepare(changed);
  other.range_noise = whole.range_noise;
  const auto same = setAside(other, aside, SurfaceOptions());
  ASSERT_EQ(same->size(), rest->size());
  for (std::size_t i = 0; i < rest->size(); ++i) {
    EXPECT_EQ(same->surface[i].first, rest->surface[i].first);
    EXPECT_EQ(same->surface[i].last, rest->surface[i].last);
    EXPECT_EQ(same->surface[i].normal, rest->surface[i].normal);
    EXPECT_EQ(same->points.beam[i], rest->points.beam[i]);
  }
}

}  // namespace
}  // namespace sckf::test
