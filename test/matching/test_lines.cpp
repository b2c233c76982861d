// Lines of scans: hand values, derivatives, covariance, and what is none.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/matrix_matchers.h"
#include "matching/feature_scans.h"
#include "sckf_odometry/matching/lines.h"

namespace sckf::test {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

LineOptions ofOneMetre() {
  LineOptions options;
  options.min_length = 1.0;
  return options;
}

LineOptions exact() {
  LineOptions options = ofOneMetre();
  options.std_offset = options.std_yaw = 0.0;
  return options;
}

std::vector<Line> linesOf(const PreparedScan& scan, const LineOptions& options = ofOneMetre()) {
  return findLines(scan, std::vector<bool>(scan.size(), false), options);
}

/// Offset of the robot from a line, and the line's yaw: what does not depend on where along it the frame is.
Vector2d offsetAndYaw(const Line& line) {
  const SE2& f = line.base_from_line;
  return {std::cos(f.yaw) * f.y - std::sin(f.yaw) * f.x, f.yaw};
}

//             ↑ x
//  robot  y ←—+
//             |
TEST(Lines, ItsFrameIsOnTheWallAndLooksAtTheRobot) {
  const auto lines = linesOf(scanOf({{{3.0, -1.0}, {3.0, 2.0}}}));
  ASSERT_EQ(lines.size(), 1U);
  const SE2& frame = lines[0].base_from_line;
  EXPECT_NEAR(frame.x, 3.0, 1e-4);
  EXPECT_NEAR(frame.yaw, M_PI_2, 1e-4);
  // Its ends, wherever its origin is.
  EXPECT_NEAR((frame * Vector2d(lines[0].from, 0.0)).y(), -1.0, 0.05);
  EXPECT_NEAR((frame * Vector2d(lines[0].to, 0.0)).y(), 2.0, 0.05);
  EXPECT_LT(lines[0].from, 0.0);
  EXPECT_GT(lines[0].to, 0.0);
}

TEST(Lines, FromTheOtherSideItIsAnother) {
  const World world{{{0.0, -2.0}, {0.0, 2.0}}};
  const auto of = [&](const SE2& robot) {
    const auto lines = linesOf(prepare(simulateScan(world, robot, fineLaser())));
    EXPECT_EQ(lines.size(), 1U);
    return compose(robot, lines.at(0).base_from_line);
  };
  EXPECT_NEAR(std::abs(wrapAngle(of(SE2(-2.0, 0.0, 0.3)).yaw - of(SE2(2.0, 0.0, 1.0)).yaw)), M_PI, 1e-4);
}

TEST(Lines, OfARoomAllAreFoundAndNoneSharesAPoint) {
  const World world = closedPolygon({{-3, -2}, {4, -2}, {4, 3}, {-3, 3}});
  std::mt19937_64 random(7);
  const auto lines = linesOf(prepare(simulateScan(world, SE2(), fineLaser(0.01), &random)));
  ASSERT_GE(lines.size(), 4U);  // that in which the scan begins and ends is two
  ASSERT_LE(lines.size(), 5U);
  double length = 0.0;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    double nearest = 1e9;
    for (const Vector2d& wall :
         {Vector2d(2.0, 0.0), Vector2d(4.0, M_PI_2), Vector2d(3.0, M_PI), Vector2d(3.0, -M_PI_2)}) {
      const Vector2d e = offsetAndYaw(lines[i]) + Vector2d(wall.x(), -wall.y());
      nearest = std::min(nearest, std::hypot(e.x(), wrapAngle(e.y())));
    }
    EXPECT_LT(nearest, 0.02) << "line " << i << ": " << lines[i].base_from_line.vector().transpose();
    length += lines[i].to - lines[i].from;
    if (i > 0) {
      EXPECT_GT(lines[i].first, lines[i - 1].last);
    }
  }
  EXPECT_NEAR(length, 24.0, 1.0) << "the whole round";
}

TEST(Lines, WhatIsTakenIsInNone) {
  const World world{{{3.0, -3.0}, {3.0, 3.0}}};
  const PreparedScan scan = scanOf(world);
  std::vector<bool> taken(scan.size(), false);
  for (std::size_t i = 0; i < scan.size(); ++i) taken[i] = std::abs(scan.points.point[i].y() - 1.0) < 0.2;
  const auto lines = findLines(scan, taken, ofOneMetre());
  ASSERT_EQ(lines.size(), 2U) << "one on either side of it";
  for (const Line& line : lines) {
    for (int i = line.first; i <= line.last; i += line.every) EXPECT_FALSE(taken[static_cast<std::size_t>(i)]);
  }
  EXPECT_TRUE(findLines(scan, std::vector<bool>(scan.size(), true), ofOneMetre()).empty());
}

TEST(Lines, ItTakesAFewPointsSpreadOverTheWallAndLeavesTheOthers) {
  const PreparedScan scan = scanOf({{{3.0, -3.0}, {3.0, 3.0}}});
  for (const int points : {3, 6, 40, 500}) {
    LineOptions options = ofOneMetre();
    options.points = points;
    const auto lines = linesOf(scan, options);
    ASSERT_EQ(lines.size(), 1U);
    const Line& line = lines[0];
    const auto taken = line.by_range.cols();
    EXPECT_EQ(taken, (line.last - line.first) / line.every + 1);
    EXPECT_EQ((line.last - line.first) % line.every, 0);
    EXPECT_GE(line.every, 2) << "never two side by side";
    EXPECT_GE(taken, std::min<Eigen::Index>(points, static_cast<Eigen::Index>(scan.size()) / 2));
    EXPECT_LE(taken, 2 * points);
    EXPECT_EQ(line.first, 0);
    EXPECT_GT(line.last, static_cast<int>(scan.size()) - 1 - line.every);
    EXPECT_NEAR(line.to - line.from, 6.0, 0.1) << "the whole wall, whatever is taken of it";
  }
}

TEST(Lines, WhatIsNone) {
  const auto count = [](const World& world, const LineOptions& options = ofOneMetre()) {
    return linesOf(scanOf(world), options).size();
  };
  EXPECT_EQ(count({{{3.0, -0.45}, {3.0, 0.45}}}), 0U) << "too short";
  LineOptions patient = ofOneMetre();
  patient.min_length = 0.8;
  EXPECT_EQ(count({{{3.0, -0.45}, {3.0, 0.45}}}, patient), 1U) << "unless short ones are allowed";
  patient.min_points = 60;
  EXPECT_EQ(count({{{3.0, -0.45}, {3.0, 0.45}}}, patient), 0U) << "of many points";
  EXPECT_EQ(count(roundWall(2.0)), 0U) << "a round wall";
  LineOptions rough = exact();
  rough.roughness = 0.5;
  EXPECT_GE(count(roundWall(2.0), rough), 1U) << "unless that is rough enough";
  // Two walls that nothing joins are two lines, however well they are aligned.
  EXPECT_EQ(count({{{3.0, -3.0}, {3.0, -0.5}}, {{3.0, 0.5}, {3.0, 3.0}}}), 2U);
  // A door that is a little ajar ends the wall: no line takes in a part of it.
  const auto ajar = linesOf(scanOf({{{3.0, -3.0}, {3.0, 0.5}}, {{3.0, 0.5}, {2.8, 1.4}}}));
  ASSERT_EQ(ajar.size(), 1U);
  EXPECT_NEAR(std::abs(wrapAngle(ajar[0].base_from_line.yaw)), M_PI_2, 0.01);
}

TEST(Lines, NoiseDoesNotCutAWall) {
  std::mt19937_64 random(5);
  int whole = 0;
  for (int i = 0; i < 100; ++i) {
    const auto lines = linesOf(prepare(simulateScan({{{2.0, -3.0}, {2.0, 3.0}}}, SE2(), fineLaser(0.03), &random)));
    whole += lines.size() == 1 && lines[0].to - lines[0].from > 5.5 ? 1 : 0;
  }
  EXPECT_GT(whole, 80);
}

TEST(Lines, TheDerivativesByTheRanges) {
  std::mt19937_64 random(12);
  const LaserScan scan = simulateScan({{{3.0, -1.0}, {2.0, 1.5}}}, SE2(), fineLaser(0.005), &random);
  const PreparedScan prepared = prepare(scan);
  const auto lines = linesOf(prepared);
  ASSERT_EQ(lines.size(), 1U);
  const Line& line = lines[0];
  const SE2& frame = line.base_from_line;
  constexpr double kStep = 3e-4;  // ranges are floats
  for (int i = line.first; i <= line.last; ++i) {
    const bool is_taken = (i - line.first) % line.every == 0;
    const auto beam = static_cast<std::size_t>(prepared.points.beam[static_cast<std::size_t>(i)]);
    const auto at = [&](double step) {
      LaserScan changed = scan;
      changed.ranges[beam] += static_cast<float>(step);
      const auto found = linesOf(prepare(changed));
      EXPECT_EQ(found.size(), 1U);
      return found.empty() ? SE2() : between(frame, found[0].base_from_line);
    };
    const Vector3d numerical = error(at(kStep), at(-kStep)) / (2.0 * kStep);
    const Vector3d by_range =
        is_taken ? Vector3d(line.by_range.col((i - line.first) / line.every)) : Vector3d(Vector3d::Zero());
    // In the line's own frame: along it nothing is said.
    const Vector2d shift = frame.rotation().transpose() * by_range.head<2>();
    EXPECT_NEAR(shift.x(), 0.0, 1e-12);
    EXPECT_NEAR(shift.y(), numerical.y(), 2e-3) << "point " << i;
    EXPECT_NEAR(by_range.z(), numerical.z(), 2e-3) << "point " << i;
  }
}

TEST(Lines, TheCovarianceIsThatOfTheErrors) {
  const SE2 wall(2.5, 0.2, M_PI_2 - 0.4);
  const World world{{wall * Vector2d(-1.2, 0.0), wall * Vector2d(1.2, 0.0)}};
  std::mt19937_64 random(11);
  Matrix2d sampled = Matrix2d::Zero();
  Matrix2d claimed = Matrix2d::Zero();
  Vector2d mean = Vector2d::Zero();
  constexpr int kDraws = 2000;
  int found = 0;
  for (int i = 0; i < kDraws; ++i) {
    PreparedScan scan = prepare(simulateScan(world, SE2(), fineLaser(0.02), &random));
    scan.range_noise = 0.02;
    const auto lines = linesOf(scan, exact());
    if (lines.size() != 1) continue;
    ++found;
    const SE2 seen = between(wall, lines[0].base_from_line);
    const Vector2d e(seen.y, seen.yaw);
    Matrix2d P;
    const double c = std::cos(lines[0].base_from_line.yaw);
    const double s = std::sin(lines[0].base_from_line.yaw);
    Eigen::Matrix<double, 2, 3> S;
    S << -s, c, 0.0, 0.0, 0.0, 1.0;
    P = S * lines[0].covariance * S.transpose();
    EXPECT_NEAR((lines[0].covariance * Vector3d(c, s, 0.0)).norm(), 0.0, 1e-12) << "along it";
    mean += e;
    sampled += e * e.transpose();
    claimed += P;
  }
  ASSERT_GT(found, 0.9 * kDraws);
  mean /= found;
  sampled /= found;
  claimed /= found;
  EXPECT_LT(mean.cwiseAbs().cwiseQuotient(claimed.diagonal().cwiseSqrt()).maxCoeff(), 0.2) << mean.transpose();
  for (Eigen::Index i = 0; i < 2; ++i) EXPECT_NEAR(claimed(i, i) / sampled(i, i), 1.0, 0.15) << i;
  EXPECT_NEAR(claimed(0, 1), sampled(0, 1), 0.15 * std::sqrt(sampled(0, 0) * sampled(1, 1)));
}

TEST(Lines, WhatWallsAreNotIsAdded) {
  const PreparedScan scan = scanOf({{{3.0, -1.0}, {3.0, 1.0}}});
  LineOptions options = ofOneMetre();
  options.std_offset = 0.3;
  options.std_yaw = 0.2;
  const Matrix3d more = linesOf(scan, options)[0].covariance - linesOf(scan, exact())[0].covariance;
  EXPECT_TRUE(matricesNear(more, Matrix3d(Vector3d(0.09, 0.0, 0.04).asDiagonal()), 1e-9));
}

}  // namespace
}  // namespace sckf::test
