// Which points of two scans belong together.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "matching/simulated_world.h"
#include "sckf_odometry/matching/nearest_neighbours.h"

namespace sckf::test {
namespace {

std::shared_ptr<const PreparedScan> scanFrom(const SE2& pose, std::mt19937_64& random) {
  const SimulatedLaser laser;
  const World world = closedPolygon({{-3.0, -3.0}, {2.0, -3.0}, {2.0, -1.0}, {4.0, -1.0}, {4.0, 3.0}, {-3.0, 3.0}});
  return prepareScan(simulateScan(world, pose, laser, &random), laser.base_from_laser, {});
}

/// By looking at all points.
std::vector<Pair> pairsByAll(const PreparedScan& reference, const PreparedScan& current, const SE2& at, double most) {
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < current.size(); ++i) {
    const Eigen::Vector2d point = at * current.points.point[i];
    std::size_t nearest = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < reference.size(); ++k) {
      const double distance = (reference.points.point[k] - point).norm();
      if (distance >= least) continue;
      least = distance;
      nearest = k;
    }
    if (least <= most) pairs.push_back({static_cast<int>(nearest), static_cast<int>(i)});
  }
  return pairs;
}

void expectSame(const std::vector<Pair>& pairs, const std::vector<Pair>& expected, const std::string& when) {
  ASSERT_EQ(pairs.size(), expected.size()) << when;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    EXPECT_EQ(pairs[i].current, expected[i].current) << when;
    EXPECT_EQ(pairs[i].reference, expected[i].reference) << when << ", current point " << pairs[i].current;
  }
}

/// However a scan is moved over the other, and whatever was asked before: in small steps as those of an alignment that
/// ends, in large ones, back and forth, and with another bound at each step.
TEST(NearestNeighbours, AreThoseOfLookingAtAllPoints) {
  std::mt19937_64 random(41);
  const auto reference = scanFrom({0.0, 0.0, 0.0}, random);
  const auto current = scanFrom({0.3, 0.1, 0.2}, random);
  ASSERT_TRUE(reference && current);
  NearestNeighbours neighbours(*reference, *current);
  std::normal_distribution<double> gaussian(0.0, 1.0);
  SE2 at(0.3, 0.1, 0.2);
  for (const double step : {0.001, 0.01, 0.1, 1.0}) {
    for (int i = 0; i < 25; ++i) {
      at = SE2(at.x + step * gaussian(random), at.y + step * gaussian(random), at.yaw + 0.3 * step * gaussian(random));
      const double most = i % 2 == 0 ? 0.2 : 1.0;
      expectSame(neighbours.pairs(RigidMotion(at), most), pairsByAll(*reference, *current, at, most),
                 "steps of " + std::to_string(step) + ", number " + std::to_string(i));
    }
    at = SE2(0.3, 0.1, 0.2);
  }
}

TEST(NearestNeighbours, AreNotAskedForAgainWhileTheyStayTheSame) {
  std::mt19937_64 random(42);
  const auto reference = scanFrom({0.0, 0.0, 0.0}, random);
  const auto current = scanFrom({0.3, 0.1, 0.2}, random);
  NearestNeighbours neighbours(*reference, *current);
  neighbours.pairs(RigidMotion({0.3, 0.1, 0.2}), 0.2);
  EXPECT_EQ(neighbours.queries(), current->size());
  neighbours.pairs(RigidMotion({0.3, 0.1, 0.2}), 0.2);
  EXPECT_LT(neighbours.queries(), 1.05 * current->size()) << "but of the few points that lie midway between two others";
  neighbours.pairs(RigidMotion({0.302, 0.101, 0.2005}), 0.2);
  EXPECT_LT(neighbours.queries(), 1.5 * current->size());
}

TEST(PointTree, TellsTheNearestAndHowFarAllOthersAre) {
  const PointTree tree({{0.0, 0.0}, {0.3, 0.0}, {0.0, 0.4}, {2.0, 0.0}});
  const PointTree::Answer both = tree.nearest({0.0, 0.3}, 0.5);
  EXPECT_TRUE(both.found);
  EXPECT_EQ(both.nearest, 2U);
  EXPECT_NEAR(both.distance, 0.1, 1e-12);
  EXPECT_NEAR(both.next, 0.3, 1e-12);
  const PointTree::Answer one = tree.nearest({1.9, 0.0}, 0.5);  // the others are farther than is asked for
  EXPECT_TRUE(one.found);
  EXPECT_EQ(one.nearest, 3U);
  EXPECT_NEAR(one.distance, 0.1, 1e-12);
  EXPECT_NEAR(one.next, 0.5, 1e-12);
  const PointTree::Answer none = tree.nearest({5.0, 5.0}, 0.5);
  EXPECT_FALSE(none.found);
  EXPECT_NEAR(none.distance, 0.5, 1e-12);
  EXPECT_NEAR(none.next, 0.5, 1e-12);
  EXPECT_FALSE(PointTree().nearest({0.0, 0.0}, 1e9).found);
  EXPECT_FALSE(PointTree(std::vector<Eigen::Vector2d>()).nearest({0.0, 0.0}, 1e9).found);
}

TEST(NearestNeighbours, OfAReferenceWithoutPointsAreNone) {
  std::mt19937_64 random(43);
  const auto current = scanFrom({0.3, 0.1, 0.2}, random);
  const PreparedScan empty;
  EXPECT_TRUE(NearestNeighbours(empty, *current).pairs(RigidMotion(SE2()), 1.0).empty());
  EXPECT_TRUE(NearestNeighbours(*current, empty).pairs(RigidMotion(SE2()), 1.0).empty());
}

}  // namespace
}  // namespace sckf::test
