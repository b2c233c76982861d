#include <gtest/gtest.h>
#include <sensor_msgs/point_cloud2_iterator.h>

#include <cmath>

#include "sckf_odometry/ros/recorders.h"

namespace sckf {
namespace {

Stamp stampOf(int i) { return Stamp(1000000 * (i + 1)); }

std::vector<double> xOf(const nav_msgs::Path& path) {
  std::vector<double> x;
  for (const auto& pose : path.poses) x.push_back(pose.pose.position.x);
  return x;
}

std::vector<float> xOf(const sensor_msgs::PointCloud2& cloud) {
  std::vector<float> x;
  for (sensor_msgs::PointCloud2ConstIterator<float> it(cloud, "x"); it != it.end(); ++it) x.push_back(*it);
  return x;
}

TEST(PathRecorder, KeepsPosesThatAreApartAndTheNewest) {
  PathRecorder recorder(0.5, 100);
  int i = 0;
  for (const double x : {0.0, 0.2, 0.4, 0.6, 0.7}) recorder.add(stampOf(i++), SE2(x, 0.0, 0.0));
  const nav_msgs::Path path = recorder.message("odom");
  EXPECT_EQ(xOf(path), (std::vector<double>{0.0, 0.6, 0.7}));
  EXPECT_EQ(path.header.frame_id, "odom");
  EXPECT_EQ(path.header.stamp.toNSec(), 5000000u);
}

TEST(PathRecorder, ThinsALongPathAndKeepsItsWholeLength) {
  PathRecorder recorder(1.0, 8);
  for (int i = 0; i < 1000; ++i) recorder.add(stampOf(i), SE2(i, 0.0, 0.0));
  const std::vector<double> x = xOf(recorder.message("odom"));
  EXPECT_LE(x.size(), 9u);
  EXPECT_GE(x.size(), 4u);
  EXPECT_EQ(x.front(), 0.0);
  EXPECT_EQ(x.back(), 999.0);
  EXPECT_TRUE(std::is_sorted(x.begin(), x.end()));
}

TEST(PathRecorder, IsEmptyBeforeTheFirstPose) { EXPECT_TRUE(PathRecorder(1.0, 8).message("odom").poses.empty()); }

TEST(CloudRecorder, PutsPointsWhereTheRobotSawThem) {
  CloudRecorder recorder(0.1, 100);
  recorder.add(SE2(1.0, 2.0, M_PI / 2), {{3.0, 0.0}});
  const sensor_msgs::PointCloud2 cloud = recorder.message(stampOf(0), "odom");
  ASSERT_EQ(cloud.width * cloud.height, 1u);
  sensor_msgs::PointCloud2ConstIterator<float> point(cloud, "x");
  EXPECT_FLOAT_EQ(point[0], 1.0F);
  EXPECT_FLOAT_EQ(point[1], 5.0F);
  EXPECT_FLOAT_EQ(point[2], 0.0F);
  EXPECT_EQ(cloud.header.frame_id, "odom");
}

TEST(CloudRecorder, KeepsOnePointInASquareOnBothSidesOfZero) {
  CloudRecorder recorder(0.1, 100);
  recorder.add(SE2(), {{0.01, 0.0}, {0.09, 0.0}, {-0.01, 0.0}, {0.11, 0.0}, {0.01, -0.01}});
  EXPECT_EQ(xOf(recorder.message(stampOf(0), "odom")), (std::vector<float>{0.01F, -0.01F, 0.11F, 0.01F}));
}

TEST(CloudRecorder, ForgetsTheOldestAndFreesTheirSquares) {
  CloudRecorder recorder(1.0, 3);
  for (int round = 0; round < 3; ++round) {
    for (int i = 0; i < 10; ++i) recorder.add(SE2(), {{i + 0.5, 0.0}});
    EXPECT_EQ(xOf(recorder.message(stampOf(0), "odom")), (std::vector<float>{7.5F, 8.5F, 9.5F}));
  }
}

}  // namespace
}  // namespace sckf
