#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "sckf_odometry/ros/scans_without_mount.h"
#include "transforms.h"

namespace sckf::test {
namespace {

using testing::HasSubstr;

RangeMessage messageIn(const std::string& frame, unsigned int number) {
  RangeMessage message;
  message.header.frame_id = frame;
  message.header.seq = number;
  return message;
}

TEST(ScansWithoutMount, WaitUntilTfTellsTheMountOfTheirLaser) {
  TfInput tf("base_link", "", std::chrono::seconds(1));
  ScansWithoutMount scans;
  EXPECT_TRUE(scans.take(tf).empty());
  scans.add(0, messageIn("front", 1));
  scans.add(1, messageIn("/rear", 2));
  scans.add(0, messageIn("front", 3));
  EXPECT_TRUE(scans.take(tf).empty());
  EXPECT_EQ(scans.size(), 3U);
  EXPECT_THAT(scans.problem(), HasSubstr("no transform base_link -> front on TF: "));
  tf.add(transform("base_link", "rear", 0.0, SE2(-0.3, 0.0, 0.0)), true);
  const auto rear = scans.take(tf);
  ASSERT_EQ(rear.size(), 1U);
  EXPECT_EQ(rear[0].scan.laser, 1U);
  EXPECT_EQ(rear[0].scan.message.header.seq, 2U);
  EXPECT_EQ(rear[0].base_from_sensor.translation().x(), -0.3);
  tf.add(transform("base_link", "front", 0.0, SE2(0.2, 0.0, 0.0)), true);
  const auto front = scans.take(tf);
  ASSERT_EQ(front.size(), 2U);
  EXPECT_EQ(front[0].scan.message.header.seq, 1U) << "in the order in which they came";
  EXPECT_EQ(front[1].scan.message.header.seq, 3U);
  EXPECT_TRUE(scans.empty());
}

TEST(ScansWithoutMount, TheOneThatHasWaitedLongestIsGivenUpFirst) {
  TfInput tf("base_link", "", std::chrono::seconds(1));
  ScansWithoutMount scans;
  for (unsigned int i = 0; i < 4; ++i) scans.add(i, messageIn("nowhere", i));
  EXPECT_EQ(scans.giveUpBeyond(4), std::nullopt);
  EXPECT_EQ(scans.giveUpBeyond(2), 0U);
  EXPECT_EQ(scans.giveUpBeyond(2), 1U);
  EXPECT_EQ(scans.giveUpBeyond(2), std::nullopt);
  EXPECT_EQ(scans.size(), 2U);
  scans.clear();
  EXPECT_TRUE(scans.empty());
}

}  // namespace
}  // namespace sckf::test
