#include <gtest/gtest.h>
#include <sensor_msgs/point_cloud2_iterator.h>

#include <functional>
#include <limits>

#include "sckf_odometry/ros/cloud_message.h"

namespace sckf {
namespace {

using sensor_msgs::PointCloud2;
using sensor_msgs::PointField;

/// Two rows of three points (10 row, column, 0.5), with an intensity before them and padding after each row.
PointCloud2 goodCloud() {
  PointCloud2 cloud;
  sensor_msgs::PointCloud2Modifier modifier(cloud);
  modifier.setPointCloud2Fields(4, "intensity", 1, PointField::FLOAT32, "x", 1, PointField::FLOAT32, "y", 1,
                                PointField::FLOAT32, "z", 1, PointField::FLOAT32);
  cloud.width = 3;
  cloud.height = 2;
  cloud.row_step = 3 * cloud.point_step + 5;
  cloud.data.resize(2 * cloud.row_step);
  for (std::size_t row = 0; row < 2; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      const float values[] = {99.0F, 10.0F * static_cast<float>(row), static_cast<float>(column), 0.5F};
      std::memcpy(&cloud.data[row * cloud.row_step + column * cloud.point_step], values, sizeof(values));
    }
  }
  return cloud;
}

std::string problemOf(const std::function<void(PointCloud2&)>& change) {
  PointCloud2 cloud = goodCloud();
  change(cloud);
  return cloudProblem(cloud);
}

TEST(CloudMessage, PointsAreReadWhereTheSizesSay) {
  ASSERT_EQ(cloudProblem(goodCloud()), "");
  const std::vector<Eigen::Vector3f> points = toPoints(goodCloud());
  ASSERT_EQ(points.size(), 6U);
  EXPECT_EQ(points[0], Eigen::Vector3f(0.0F, 0.0F, 0.5F));
  EXPECT_EQ(points[2], Eigen::Vector3f(0.0F, 2.0F, 0.5F));
  EXPECT_EQ(points[4], Eigen::Vector3f(10.0F, 1.0F, 0.5F));
}

TEST(CloudMessage, FieldsMayComeInAnyOrder) {
  PointCloud2 cloud = goodCloud();
  std::swap(cloud.fields[1].offset, cloud.fields[3].offset);
  std::reverse(cloud.fields.begin(), cloud.fields.end());
  ASSERT_EQ(cloudProblem(cloud), "");
  EXPECT_EQ(toPoints(cloud)[4], Eigen::Vector3f(0.5F, 1.0F, 10.0F));
}

TEST(CloudMessage, AnEmptyCloudIsNone) {
  EXPECT_EQ(cloudProblem(PointCloud2()), "width is 0, height 0: points expected");
  EXPECT_EQ(problemOf([](PointCloud2& cloud) { cloud.width = 0; }), "width is 0, height 2: points expected");
}

TEST(CloudMessage, FieldsThatAreMissingAreNamed) {
  EXPECT_EQ(problemOf([](PointCloud2& cloud) { cloud.fields[3].name = "rgb"; }),
            "fields are \"intensity\" \"x\" \"y\" \"rgb\": x, y and z expected");
  EXPECT_EQ(problemOf([](PointCloud2& cloud) { cloud.fields.clear(); }), "fields are none: x, y and z expected");
}

TEST(CloudMessage, FieldsOfAnotherTypeAreRefused) {
  EXPECT_EQ(problemOf([](PointCloud2& cloud) { cloud.fields[2].datatype = PointField::FLOAT64; }),
            "field y has datatype 8: 7 (float32) expected");
}

TEST(CloudMessage, FieldsBeyondThePointAreRefused) {
  EXPECT_EQ(problemOf([](PointCloud2& cloud) { cloud.fields[3].offset = 13; }),
            "field z has offset 13, point_step is 16: a field within the point expected");
  EXPECT_EQ(problemOf([](PointCloud2& cloud) { cloud.fields[1].offset = std::numeric_limits<std::uint32_t>::max(); }),
            "field x has offset 4294967295, point_step is 16: a field within the point expected");
  EXPECT_EQ(problemOf([](PointCloud2& cloud) { cloud.point_step = 0; }),
            "field x has offset 4, point_step is 0: a field within the point expected");
}

TEST(CloudMessage, SizesThatContradictEachOtherAreRefused) {
  EXPECT_EQ(problemOf([](PointCloud2& cloud) { cloud.row_step = 47; }),
            "row_step is 47, width 3, point_step 16: rows of width points expected");
  EXPECT_EQ(problemOf([](PointCloud2& cloud) { cloud.data.pop_back(); }),
            "data has 105 bytes, height is 2, row_step 53: height rows expected");
  EXPECT_NE(problemOf([](PointCloud2& cloud) { cloud.width = std::numeric_limits<std::uint32_t>::max(); }), "");
  EXPECT_NE(
      problemOf([](PointCloud2& cloud) { cloud.height = cloud.row_step = std::numeric_limits<std::uint32_t>::max(); }),
      "");
}

TEST(CloudMessage, TheOtherOrderOfBytesIsRefused) {
  EXPECT_EQ(problemOf([](PointCloud2& cloud) { cloud.is_bigendian = true; }),
            "is_bigendian is true: the order of bytes of this machine expected");
}

}  // namespace
}  // namespace sckf
