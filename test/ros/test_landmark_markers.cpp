#include <gtest/gtest.h>

#include <cmath>

#include "sckf_odometry/ros/landmark_markers.h"

namespace sckf {
namespace {

using visualization_msgs::Marker;

TEST(LandmarkMarkers, WithoutLandmarksWhatWasThereIsDeleted) {
  const auto array = landmarkMarkers({}, Stamp(7000000001), "odom");
  ASSERT_EQ(array.markers.size(), 6U);
  for (const Marker& marker : array.markers) {
    EXPECT_EQ(marker.action, Marker::DELETE);
    EXPECT_EQ(marker.header.frame_id, "odom");
    EXPECT_EQ(marker.header.stamp.toNSec(), 7000000001U);
  }
}

TEST(LandmarkMarkers, EachHasItsCrossAndItsEllipse) {
  LandmarkView seen{SE2(1.0, 2.0, M_PI_2), Eigen::Vector3d(0.04, 0.01, 1.0).asDiagonal(), true};
  LandmarkView other{SE2(5.0, 6.0, 0.0), Eigen::Matrix3d::Zero(), false};
  const auto array = landmarkMarkers({seen, other}, Stamp(1), "odom");
  const Marker& others = array.markers[0];
  const Marker& seen_ones = array.markers[1];
  const Marker& covariance = array.markers[2];
  EXPECT_EQ(seen_ones.ns, "seen");
  ASSERT_EQ(seen_ones.points.size(), 4U);
  EXPECT_NEAR(seen_ones.points[0].x, 1.0, 1e-9);
  EXPECT_NEAR(seen_ones.points[1].x, 1.0, 1e-9) << "the long stroke looks along y";
  EXPECT_GT(seen_ones.points[1].y, 2.2);
  ASSERT_EQ(others.points.size(), 4U);
  EXPECT_NEAR(others.points[0].x, 5.0, 1e-9);
  ASSERT_EQ(covariance.points.size(), 128U);
  double along = 0.0;
  double across = 0.0;
  for (std::size_t i = 0; i < 64; ++i) {
    along = std::max(along, std::abs(covariance.points[i].x - 1.0));
    across = std::max(across, std::abs(covariance.points[i].y - 2.0));
  }
  const double radius = std::sqrt(5.991);  // of χ² with two degrees of freedom, 95 %
  EXPECT_NEAR(along, 0.2 * radius, 1e-3);
  EXPECT_NEAR(across, 0.1 * radius, 1e-3);
  for (std::size_t i = 3; i < 6; ++i) EXPECT_EQ(array.markers[i].action, Marker::DELETE) << "there is no line";
}

// A wall along y, known from 1 m before its origin to 3 m after it; its offset is in x.
TEST(LandmarkMarkers, ALineHasItsStretchAndItsBand) {
  LandmarkView seen{SE2(1.0, 2.0, M_PI_2), Eigen::Vector3d(0.04, 25.0, 0.01).asDiagonal(), true, true, -1.0, 3.0};
  LandmarkView other{SE2(5.0, 6.0, 0.0), Eigen::Matrix3d::Zero(), false, true, 0.0, 2.0};
  const auto array = landmarkMarkers({seen, other}, Stamp(1), "odom");
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(array.markers[i].action, Marker::DELETE) << "there is no corner";
  const Marker& others = array.markers[3];
  const Marker& seen_ones = array.markers[4];
  const Marker& bands = array.markers[5];
  EXPECT_EQ(seen_ones.ns, "seen_lines");
  ASSERT_EQ(seen_ones.points.size(), 2U);
  EXPECT_NEAR(seen_ones.points[0].x, 1.0, 1e-9);
  EXPECT_NEAR(seen_ones.points[0].y, 1.0, 1e-9);
  EXPECT_NEAR(seen_ones.points[1].x, 1.0, 1e-9);
  EXPECT_NEAR(seen_ones.points[1].y, 5.0, 1e-9);
  ASSERT_EQ(others.points.size(), 2U);
  EXPECT_NEAR(others.points[1].x, 7.0, 1e-9);
  ASSERT_EQ(bands.points.size(), 128U);
  for (std::size_t i = 0; i < 64; ++i) {
    const double lever = bands.points[i].y - 2.0;
    const double std = std::sqrt(0.04 + lever * lever * 0.01);
    EXPECT_NEAR(std::abs(bands.points[i].x - 1.0), 1.96 * std, 1e-3) << "whatever is known along it";
  }
  EXPECT_GT(bands.points[0].x, 1.0);
  EXPECT_LT(bands.points[32].x, 1.0);
}

}  // namespace
}  // namespace sckf
