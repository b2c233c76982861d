#include <gtest/gtest.h>

#include "sckf_odometry/pipeline/waiting_scans.h"

namespace sckf {
namespace {

Stamp ms(int count) { return std::chrono::milliseconds(count); }

WaitingScans waiting(const std::vector<int>& stamps) {
  WaitingScans scans;
  for (const int stamp : stamps) {
    LaserScan scan;
    scan.stamp = ms(stamp);
    scan.ranges = {static_cast<float>(scans.size())};  // by its arrival
    scans.add(scan, Eigen::Isometry3d::Identity());
  }
  return scans;
}

TEST(WaitingScans, AreTakenByStampAndOfEqualStampsByArrival) {
  WaitingScans scans = waiting({30, 10, 20, 10});
  EXPECT_EQ(scans.size(), 4U);
  EXPECT_EQ(scans.oldest(), ms(10));
  for (const float arrival : {1.0F, 3.0F, 2.0F, 0.0F}) EXPECT_EQ(scans.takeOldest().scan.ranges.front(), arrival);
  EXPECT_TRUE(scans.empty());
}

TEST(WaitingScans, CountsThoseAfterAnInstant) {
  const WaitingScans scans = waiting({30, 10, 20, 20});
  EXPECT_EQ(scans.countAfter(ms(9)), 4U);
  EXPECT_EQ(scans.countAfter(ms(10)), 3U);
  EXPECT_EQ(scans.countAfter(ms(20)), 1U);
  EXPECT_EQ(scans.countAfter(ms(30)), 0U);
}

/// A scan from the future would else stay for ever, and in its place good ones were given up.
TEST(WaitingScans, GivesUpTheOneThatHasWaitedLongest) {
  WaitingScans scans = waiting({90000, 10, 20});
  EXPECT_EQ(scans.giveUp().scan.stamp, ms(90000));
  EXPECT_EQ(scans.giveUp().scan.stamp, ms(10));
  EXPECT_EQ(scans.size(), 1U);
  EXPECT_EQ(scans.oldest(), ms(20));
}

}  // namespace
}  // namespace sckf
