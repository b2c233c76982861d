#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "sckf_odometry/pipeline/imu_buffer.h"

namespace sckf {
namespace {

using Insertion = ImuBuffer::Insertion;

Stamp at(int ms) { return std::chrono::seconds(1000) + std::chrono::milliseconds(ms); }

/// A robot that turns faster and faster: the rate is t, the yaw t²/2.
ImuSample reading(int ms) { return {at(ms), 1e-3 * ms, 0.5e-6 * ms * ms}; }

class ImuBufferTest : public testing::Test {
 protected:
  void fill(int from, int to, int step = 10) {
    for (int ms = from; ms <= to; ms += step) EXPECT_EQ(imu_.insert(reading(ms)), Insertion::kInserted);
  }

  ImuBuffer imu_{0.05};
};

TEST_F(ImuBufferTest, RotationIsTheIntegralOfTheRateWhateverTheEnds) {
  fill(0, 1000);
  EXPECT_NEAR(imu_.rotation(at(0), at(1000)).value(), 0.5, 1e-12);
  EXPECT_NEAR(imu_.rotation(at(203), at(707)).value(), 0.5 * (0.707 * 0.707 - 0.203 * 0.203), 1e-12);
  EXPECT_NEAR(imu_.rotation(at(203), at(204)).value(), 0.5 * (0.204 * 0.204 - 0.203 * 0.203), 1e-12) << "between two";
  EXPECT_NEAR(imu_.rotation(at(200), at(210)).value(), 0.5 * (0.21 * 0.21 - 0.2 * 0.2), 1e-12)
      << "from one to the next";
}

TEST_F(ImuBufferTest, WhatIsNotCoveredWhollyIsNotMeasured) {
  EXPECT_FALSE(imu_.rotation(at(0), at(10)));
  EXPECT_FALSE(imu_.yaw(at(0)));
  fill(0, 200);
  fill(300, 500);
  EXPECT_FALSE(imu_.rotation(at(-1), at(100)));
  EXPECT_FALSE(imu_.rotation(at(490), at(501)));
  EXPECT_FALSE(imu_.rotation(at(190), at(310))) << "over the gap";
  EXPECT_FALSE(imu_.rotation(at(190), at(250))) << "into it";
  EXPECT_FALSE(imu_.rotation(at(250), at(310))) << "out of it";
  EXPECT_FALSE(imu_.yaw(at(250)));
  EXPECT_FALSE(imu_.yaw(at(501)));
  EXPECT_TRUE(imu_.rotation(at(0), at(200)));
  EXPECT_TRUE(imu_.rotation(at(300), at(500)));
  EXPECT_FALSE(imu_.rotation(at(100), at(100))) << "no time";
}

TEST_F(ImuBufferTest, TheYawIsInterpolatedTheShorterWay) {
  imu_.insert({at(0), {}, M_PI - 0.1});
  imu_.insert({at(10), {}, -M_PI + 0.1});
  EXPECT_NEAR(imu_.yaw(at(0)).value(), M_PI - 0.1, 1e-12);
  EXPECT_NEAR(imu_.yaw(at(2)).value(), M_PI - 0.06, 1e-12);
  EXPECT_NEAR(imu_.yaw(at(8)).value(), -M_PI + 0.06, 1e-12);
  EXPECT_FALSE(imu_.rotation(at(0), at(10))) << "there is no rate";
}

TEST_F(ImuBufferTest, AYawIsTakenOnce) {
  fill(0, 60);
  EXPECT_TRUE(imu_.takeYaw(at(5)));
  EXPECT_FALSE(imu_.takeYaw(at(5))) << "the same instant";
  EXPECT_FALSE(imu_.takeYaw(at(7))) << "between the same two";
  EXPECT_FALSE(imu_.takeYaw(at(12))) << "one of them";
  EXPECT_NEAR(imu_.takeYaw(at(20)).value(), imu_.yaw(at(20)).value(), 0.0);
  EXPECT_FALSE(imu_.takeYaw(at(25))) << "which begins where the last one was";
  EXPECT_TRUE(imu_.takeYaw(at(35)));
  imu_.forgetTaken();
  EXPECT_TRUE(imu_.takeYaw(at(35)));
}

TEST_F(ImuBufferTest, AReadingWithoutRateOrWithoutYawLeavesAHole) {
  fill(0, 20);
  imu_.insert({at(30), {}, {}});
  fill(40, 60);
  EXPECT_FALSE(imu_.rotation(at(10), at(50)));
  EXPECT_FALSE(imu_.yaw(at(25)));
  EXPECT_TRUE(imu_.rotation(at(0), at(20)));
  EXPECT_TRUE(imu_.yaw(at(45)));
}

TEST_F(ImuBufferTest, ReadingsAreSortedAndEachStampComesOnce) {
  for (const int ms : {40, 0, 20, 10, 30}) EXPECT_EQ(imu_.insert(reading(ms)), Insertion::kInserted);
  EXPECT_EQ(imu_.insert({at(20), 99.0, 99.0}), Insertion::kDuplicate);
  EXPECT_EQ(imu_.newest(), at(40));
  EXPECT_NEAR(imu_.rotation(at(0), at(40)).value(), 0.5 * 0.04 * 0.04, 1e-12);
}

TEST_F(ImuBufferTest, WhatIsNoReadingIsRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(imu_.insert({at(0), nan, 0.0}), Insertion::kNotFinite);
  EXPECT_EQ(imu_.insert({at(0), 0.0, std::numeric_limits<double>::infinity()}), Insertion::kNotFinite);
  EXPECT_EQ(imu_.insert({at(0), 1e300, 0.0}), Insertion::kNotFinite);
  EXPECT_EQ(imu_.insert({Stamp(-1), 0.0, 0.0}), Insertion::kNotFinite);
  EXPECT_TRUE(imu_.empty());
}

TEST_F(ImuBufferTest, WhatIsForgottenStaysSo) {
  fill(0, 100);
  imu_.discardBefore(at(55));
  EXPECT_EQ(imu_.size(), 6U);
  EXPECT_TRUE(imu_.rotation(at(55), at(100)));
  EXPECT_EQ(imu_.insert(reading(54)), Insertion::kTooOld);
  EXPECT_EQ(imu_.insert(reading(56)), Insertion::kInserted);
}

TEST_F(ImuBufferTest, ItDoesNotGrowWithoutOdometry) {
  for (int ms = 0; ms < 30000; ++ms) imu_.insert(reading(ms));
  EXPECT_EQ(imu_.size(), 20000U);
  EXPECT_EQ(imu_.newest(), at(29999));
}

}  // namespace
}  // namespace sckf
