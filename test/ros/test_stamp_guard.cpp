#include <gmock/gmock.h>

#include "sckf_odometry/ros/stamp_guard.h"

namespace sckf {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

Stamp at(double time) { return std::chrono::duration_cast<Stamp>(std::chrono::duration<double>(time)); }

/// A guard whose messages are their own stamps, on a clock that says what is set.
class Guard {
 public:
  std::vector<double> admit(double stamp) {
    last_ = guard_.admit(at(stamp), stamp, at(now), at(other));
    return last_.passed;
  }
  std::size_t dropped() const { return last_.dropped; }
  double timeJump() const { return seconds(last_.time_jump); }
  std::size_t heldBack() const { return guard_.heldBack(); }
  void restart() { guard_.restart(); }

  double now = 0.0;
  double other = 0.0;

 private:
  StampGuard<double> guard_{1.0};
  StampGuard<double>::Admission last_;
};

Guard startedAt(double time) {
  Guard guard;
  guard.now = time;
  guard.admit(time);
  return guard;
}

TEST(StampGuard, StampsThatGoOnPass) {
  Guard guard = startedAt(100.0);
  EXPECT_THAT(guard.admit(100.1), ElementsAre(100.1));
  EXPECT_THAT(guard.admit(99.5), ElementsAre(99.5));    // late
  EXPECT_THAT(guard.admit(100.1), ElementsAre(100.1));  // twice
  EXPECT_EQ(guard.heldBack(), 0u);
}

TEST(StampGuard, TheFirstIsBelievedUntilThreeOthersKnowBetter) {
  Guard guard;
  guard.now = 5000.0;
  EXPECT_THAT(guard.admit(600.0), ElementsAre(600.0));
  EXPECT_THAT(guard.admit(100.0), IsEmpty());
  EXPECT_THAT(guard.admit(100.1), IsEmpty());
  EXPECT_THAT(guard.admit(100.2), ElementsAre(100.0, 100.1, 100.2));
  EXPECT_DOUBLE_EQ(guard.timeJump(), -500.0);
}

TEST(StampGuard, OneWrongStampIsDroppedWhenTheNextGoesOn) {
  for (const double wrong : {600.0, 20.0}) {
    Guard guard = startedAt(100.0);
    EXPECT_THAT(guard.admit(wrong), IsEmpty()) << wrong;
    EXPECT_EQ(guard.heldBack(), 1u) << wrong;
    EXPECT_THAT(guard.admit(100.1), ElementsAre(100.1)) << wrong;
    EXPECT_EQ(guard.dropped(), 1u) << wrong;
    EXPECT_EQ(guard.heldBack(), 0u) << wrong;
  }
}

TEST(StampGuard, WrongStampsThatDontGoOnFromEachOtherAreNoJump) {
  Guard guard = startedAt(100.0);
  for (const double wrong : {600.0, 20.0, 400.0, 50.0, 900.0}) EXPECT_THAT(guard.admit(wrong), IsEmpty());
  EXPECT_EQ(guard.dropped(), 1u);
  EXPECT_THAT(guard.admit(100.1), ElementsAre(100.1));
}

TEST(StampGuard, ThreeInARowAreAJumpAndNoneOfThemIsLost) {
  for (const double begin : {40.0, 700.0}) {
    Guard guard = startedAt(100.0);
    guard.admit(begin);
    guard.admit(begin + 0.1);
    EXPECT_THAT(guard.admit(begin + 0.2), ElementsAre(begin, begin + 0.1, begin + 0.2));
    EXPECT_DOUBLE_EQ(guard.timeJump(), begin - 100.0);
    EXPECT_THAT(guard.admit(begin + 0.3), ElementsAre(begin + 0.3));
    EXPECT_EQ(guard.timeJump(), 0.0);
  }
}

TEST(StampGuard, AGapIsNoJumpWhileTheClockSaysTheSame) {
  Guard guard = startedAt(100.0);
  guard.now = 130.0;
  EXPECT_THAT(guard.admit(130.0), ElementsAre(130.0));
  guard.now = 133.0;
  EXPECT_THAT(guard.admit(138.0), IsEmpty());  // ahead of everybody
  EXPECT_THAT(guard.admit(133.0), ElementsAre(133.0));
}

TEST(StampGuard, WithoutAClockAGapOfTenTimesTheJumpIsBelieved) {
  Guard guard = startedAt(100.0);
  guard.now = 0.0;
  EXPECT_THAT(guard.admit(109.0), ElementsAre(109.0));
  EXPECT_THAT(guard.admit(120.0), IsEmpty());
}

TEST(StampGuard, AnotherRowOfTheSameClockVouches) {
  Guard guard;
  guard.now = 5000.0;
  guard.other = 100.0;
  EXPECT_THAT(guard.admit(700.0), IsEmpty());
  EXPECT_THAT(guard.admit(100.2), ElementsAre(100.2));
  guard.other = 300.0;
  EXPECT_THAT(guard.admit(300.1), ElementsAre(300.1));
}

TEST(StampGuard, WhatWasHeldBackPassesWithTheOneThatGoesOnFromIt) {
  Guard guard = startedAt(100.0);
  EXPECT_THAT(guard.admit(50.0), IsEmpty());
  guard.restart();
  guard.other = 50.1;
  EXPECT_THAT(guard.admit(50.2), ElementsAre(50.0, 50.2));
  EXPECT_EQ(guard.dropped(), 0u);
}

}  // namespace
}  // namespace sckf
