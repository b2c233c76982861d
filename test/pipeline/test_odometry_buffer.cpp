#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "core/matrix_matchers.h"
#include "sckf_odometry/pipeline/odometry_buffer.h"

namespace sckf {
namespace {

using Insertion = OdometryBuffer::Insertion;

Stamp ms(int count) { return std::chrono::milliseconds(count); }

OdometrySample sample(Stamp stamp, const SE2& pose) {
  OdometrySample s;
  s.stamp = stamp;
  s.odom_from_base = pose;
  return s;
}

/// Samples at these times, the robot on its way along x with 1 m/s.
OdometryBuffer straight(const std::vector<int>& times) {
  OdometryBuffer buffer;
  for (const int time : times) EXPECT_EQ(buffer.insert(sample(ms(time), SE2(1e-3 * time, 0, 0))), Insertion::kInserted);
  return buffer;
}

std::vector<int> ends(const std::vector<OdometryBuffer::Step>& steps) {
  std::vector<int> times;
  for (const auto& step : steps) times.push_back(static_cast<int>(std::lround(1e3 * seconds(step.to.stamp))));
  return times;
}

SE2 motion(const std::vector<OdometryBuffer::Step>& steps) {
  SE2 total;
  for (const auto& step : steps) total = compose(total, between(step.from.odom_from_base, step.to.odom_from_base));
  return total;
}

/// Each step begins where the one before it ended, in time and place.
void expectChained(const std::vector<OdometryBuffer::Step>& steps) {
  for (std::size_t i = 1; i < steps.size(); ++i) {
    EXPECT_EQ(steps[i].from.stamp, steps[i - 1].to.stamp);
    EXPECT_TRUE(matricesNear(steps[i].from.odom_from_base.vector(), steps[i - 1].to.odom_from_base.vector(), 0.0));
  }
}

TEST(OdometryBuffer, IsEmptyAtFirst) {
  const OdometryBuffer buffer;
  EXPECT_TRUE(buffer.empty());
  EXPECT_FALSE(buffer.covers(ms(0)));
}

TEST(OdometryBuffer, SortsWhatComesInAnyOrder) {
  const OdometryBuffer buffer = straight({30, 10, 50, 20, 40});
  EXPECT_EQ(buffer.oldest(), ms(10));
  EXPECT_EQ(buffer.newest(), ms(50));
  EXPECT_THAT(ends(buffer.steps(ms(10), ms(50))), testing::ElementsAre(20, 30, 40, 50));
  EXPECT_DOUBLE_EQ(buffer.steps(ms(40), ms(50)).back().to.odom_from_base.x, 0.05);
}

TEST(OdometryBuffer, OfEqualStampsTheFirstCounts) {
  OdometryBuffer buffer = straight({0, 10, 20});
  for (const int time : {0, 10, 20}) {
    EXPECT_EQ(buffer.insert(sample(ms(time), SE2(9, 9, 1))), Insertion::kDuplicate) << time << " ms";
  }
  EXPECT_NEAR(motion(buffer.steps(ms(0), ms(20))).x, 0.02, 1e-15);
  EXPECT_EQ(buffer.steps(ms(0), ms(20)).size(), 2U);
}

TEST(OdometryBuffer, CoversWhatLiesBetweenItsSamplesAndThemselves) {
  const OdometryBuffer buffer = straight({10, 20});
  EXPECT_FALSE(buffer.covers(ms(10) - Stamp(1)));
  EXPECT_TRUE(buffer.covers(ms(10)));
  EXPECT_TRUE(buffer.covers(ms(15)));
  EXPECT_TRUE(buffer.covers(ms(20)));
  EXPECT_FALSE(buffer.covers(ms(20) + Stamp(1)));
}

TEST(OdometryBuffer, StepsBeginAndEndBetweenSamples) {
  const OdometryBuffer buffer = straight({0, 20, 40, 60});
  const auto steps = buffer.steps(ms(5), ms(50));
  EXPECT_THAT(ends(steps), testing::ElementsAre(20, 40, 50));
  EXPECT_EQ(steps.front().from.stamp, ms(5));
  EXPECT_NEAR(steps.front().from.odom_from_base.x, 0.005, 1e-15);
  EXPECT_NEAR(steps.back().to.odom_from_base.x, 0.050, 1e-15);
  expectChained(steps);
}

TEST(OdometryBuffer, StepsWithinOneIntervalAreOneStep) {
  const auto steps = straight({0, 100}).steps(ms(25), ms(75));
  ASSERT_EQ(steps.size(), 1U);
  EXPECT_NEAR(motion(steps).x, 0.05, 1e-15);
}

TEST(OdometryBuffer, StepsAtSamplesNeedNoInterpolation) {
  const auto steps = straight({0, 20, 40}).steps(ms(20), ms(40));
  ASSERT_EQ(steps.size(), 1U);
  EXPECT_EQ(steps[0].from.stamp, ms(20));
  EXPECT_EQ(steps[0].to.stamp, ms(40));
}

TEST(OdometryBuffer, NoStepsWhereNoTimePasses) {
  const OdometryBuffer buffer = straight({0, 20, 40});
  EXPECT_TRUE(buffer.steps(ms(10), ms(10)).empty());
  EXPECT_TRUE(buffer.steps(ms(20), ms(20)).empty());
  EXPECT_TRUE(buffer.steps(ms(30), ms(10)).empty());
}

TEST(OdometryBuffer, TurnsTheShortWayAcrossTheBackwardDirection) {
  OdometryBuffer buffer;
  buffer.insert(sample(ms(0), SE2(0, 0, M_PI - 0.1)));
  buffer.insert(sample(ms(100), SE2(0, 0, -M_PI + 0.3)));
  const auto steps = buffer.steps(ms(0), ms(50));
  ASSERT_EQ(steps.size(), 1U);
  EXPECT_NEAR(wrapAngle(steps[0].to.odom_from_base.yaw - (-M_PI + 0.1)), 0.0, 1e-12);
  EXPECT_NEAR(motion(buffer.steps(ms(25), ms(75))).yaw, 0.2, 1e-12);
}

/// A robot on a circle of radius 2 m with 1 rad/s, seen every 100 ms, from a pose that is turned against the frame.
TEST(OdometryBuffer, FollowsACurve) {
  const SE2 start(3, -1, 2.0);
  const auto onCircle = [&start](double t) { return compose(start, SE2(2 * std::sin(t), 2 * (1 - std::cos(t)), t)); };
  OdometryBuffer buffer;
  for (int time = 0; time <= 2000; time += 100) buffer.insert(sample(ms(time), onCircle(1e-3 * time)));
  for (int from = 0; from < 1900; from += 230) {
    for (int to = from + 7; to <= 2000; to += 310) {
      const auto steps = buffer.steps(ms(from), ms(to));
      expectChained(steps);
      const SE2 truth = between(onCircle(1e-3 * from), onCircle(1e-3 * to));
      const Eigen::Vector3d off = error(motion(steps), truth);
      EXPECT_LT(off.head<2>().norm(), 1e-9) << from << " to " << to << " ms: off by " << off.transpose();
      EXPECT_NEAR(off.z(), 0.0, 1e-12) << from << " to " << to << " ms";
    }
  }
}

TEST(OdometryBuffer, AnInterpolatedSampleHasTheTwistCovarianceOfItsInterval) {
  OdometryBuffer buffer;
  for (int i = 0; i < 3; ++i) {
    OdometrySample s = sample(ms(100 * i), SE2());
    s.twist_covariance = (i + 1.0) * Eigen::Matrix3d::Identity();
    buffer.insert(s);
  }
  const auto steps = buffer.steps(ms(50), ms(150));
  ASSERT_EQ(steps.size(), 2U);
  EXPECT_DOUBLE_EQ((*steps[0].to.twist_covariance)(0, 0), 2.0);
  EXPECT_DOUBLE_EQ((*steps[1].to.twist_covariance)(0, 0), 3.0);
}

TEST(OdometryBuffer, AStepKnowsTheIntervalThatItIsAPartOf) {
  OdometryBuffer buffer = straight({0, 100, 300, 340});
  for (const Stamp from : {ms(0), ms(10), ms(50)}) {
    SCOPED_TRACE(testing::Message() << from.count() << " ns");
    const auto steps = buffer.steps(from, ms(150));
    ASSERT_EQ(steps.size(), 2U);
    EXPECT_DOUBLE_EQ(steps[0].interval, 0.1);
    EXPECT_DOUBLE_EQ(steps[1].interval, 0.2);
  }
  buffer.discardBefore(ms(310));
  EXPECT_DOUBLE_EQ(buffer.steps(ms(310), ms(330)).front().interval, 0.04);
}

TEST(OdometryBuffer, ForgettingKeepsTheSampleBefore) {
  OdometryBuffer buffer = straight({0, 20, 40, 60, 80});
  buffer.discardBefore(ms(50));
  EXPECT_EQ(buffer.oldest(), ms(40));
  EXPECT_NEAR(motion(buffer.steps(ms(50), ms(80))).x, 0.03, 1e-15);
  buffer.discardBefore(ms(60));
  EXPECT_EQ(buffer.oldest(), ms(60));
  EXPECT_TRUE(buffer.covers(ms(60)));
}

TEST(OdometryBuffer, ForgettingEverythingKeepsTheLast) {
  OdometryBuffer buffer = straight({0, 20});
  buffer.discardBefore(ms(1000));
  ASSERT_FALSE(buffer.empty());
  EXPECT_EQ(buffer.oldest(), ms(20));
}

TEST(OdometryBuffer, RefusesWhatComesAfterItsTimeHasBeenTaken) {
  OdometryBuffer buffer = straight({0, 20, 40, 60});
  buffer.discardBefore(ms(30));
  EXPECT_EQ(buffer.insert(sample(ms(30) - Stamp(1), SE2())), Insertion::kTooOld);
  EXPECT_EQ(buffer.insert(sample(ms(5), SE2())), Insertion::kTooOld);
  EXPECT_EQ(buffer.insert(sample(ms(35), SE2(0.035, 0, 0))), Insertion::kInserted);
  EXPECT_THAT(ends(buffer.steps(ms(30), ms(60))), testing::ElementsAre(35, 40, 60));
}

TEST(OdometryBuffer, HoldsNoMoreThanItsWindow) {
  OdometryBuffer buffer;
  for (int time = 0; time < 100000; ++time) {
    buffer.insert(sample(ms(time), SE2(1e-3 * time, 0, 0)));
    buffer.discardBefore(ms(time - 100));
    ASSERT_LE(buffer.newest() - buffer.oldest(), ms(101));
  }
  EXPECT_LE(buffer.steps(buffer.oldest(), buffer.newest()).size(), 101U);
}

// ---- steps that are no motion ---------------------------------------------------------------------------------------

/// Which steps are guesses: "k" known, "?" guess.
std::string knowledge(const std::vector<OdometryBuffer::Step>& steps) {
  std::string text;
  for (const auto& step : steps) text += step.guess ? '?' : 'k';
  return text;
}

const MotionGuess kGuess{Eigen::Vector3d(1, 0, 0), ms(20)};

TEST(OdometryBuffer, AStepBeyondTheLimitsIsNoMotion) {
  OdometryBuffer buffer = straight({0, 20});
  buffer.insert(sample(ms(40), SE2(7, 0, 0)), kGuess);  // the driver's frame has jumped …
  buffer.insert(sample(ms(60), SE2(7.02, 0, 0)), kGuess);
  buffer.insert(sample(ms(80), SE2(7.02, 0, 2.0)), kGuess);  // … and again, in yaw
  const auto steps = buffer.steps(ms(0), ms(80));
  EXPECT_EQ(knowledge(steps), "k?k?");
  EXPECT_EQ(buffer.jumps(), 2U);
  EXPECT_EQ(steps[1].guess->since, ms(20));
  EXPECT_EQ(steps[1].guess->velocity.x(), 1.0);
}

/// Half of a jump could be motion by itself.
TEST(OdometryBuffer, AJumpStaysOneWhereItIsInterpolated) {
  OdometryBuffer buffer = straight({0, 20});
  buffer.insert(sample(ms(40), SE2(0.9, 0, 0)), kGuess);
  EXPECT_EQ(knowledge(buffer.steps(ms(0), ms(30))), "k?");
  EXPECT_EQ(knowledge(buffer.steps(ms(30), ms(40))), "?");
  buffer.discardBefore(ms(30));
  EXPECT_EQ(knowledge(buffer.steps(ms(30), ms(40))), "?") << "its beginning taken, the rest is still of the jump";
}

TEST(OdometryBuffer, ALateSampleDecidesAnewWhatIsMotion) {
  OdometryBuffer buffer = straight({0});
  EXPECT_EQ(buffer.insert(sample(ms(400), SE2(3.0, 0, 0)), kGuess), Insertion::kInserted);
  EXPECT_EQ(knowledge(buffer.steps(ms(0), ms(400))), "?");  // 3 m in 0.4 s
  EXPECT_EQ(buffer.jumps(), 1U);
  buffer.insert(sample(ms(300), SE2(1.5, 0, 0)), kGuess);
  EXPECT_EQ(knowledge(buffer.steps(ms(0), ms(400))), "k?");
  buffer.insert(sample(ms(350), SE2(2.3, 0, 0)), kGuess);  // bursts: 0.7 m in 50 ms, and once more
  EXPECT_EQ(knowledge(buffer.steps(ms(0), ms(400))), "k?k");
  EXPECT_EQ(buffer.jumps(), 1U);
  buffer.insert(sample(ms(325), SE2(1.9, 0, 0)), kGuess);
  EXPECT_EQ(knowledge(buffer.steps(ms(0), ms(400))), "kkkk");
  EXPECT_EQ(buffer.jumps(), 0U);
}

/// After silence at a place away from the origin the driver says the origin: it has begun anew.
TEST(OdometryBuffer, ASilenceThatEndsAtTheOriginIsAReset) {
  for (const int silence : {900, 5000}) {
    for (const SE2& after : {SE2(), SE2(0.05, 0, 0.05), SE2(1.2, 0, 0)}) {
      OdometryBuffer buffer;
      buffer.insert(sample(ms(0), SE2(2.0, 0, 0)), kGuess);
      buffer.insert(sample(ms(silence), after), kGuess);
      buffer.insert(sample(ms(silence + 20), after), kGuess);
      const bool reset = silence > 1000 && after.x < 1.0;
      EXPECT_EQ(knowledge(buffer.steps(ms(0), ms(silence + 20))), reset ? "?k" : "kk") << silence << " ms, " << after.x;
    }
  }
}

TEST(OdometryBuffer, NearTheOriginASilenceIsAPauseLikeAnyOther) {
  OdometryBuffer buffer;
  buffer.insert(sample(ms(0), SE2(0.3, 0, 0)));
  buffer.insert(sample(ms(5000), SE2()));
  buffer.insert(sample(ms(5020), SE2()));
  EXPECT_EQ(knowledge(buffer.steps(ms(0), ms(5020))), "kk");
}

TEST(OdometryBuffer, NoMotionLeadsOutOfABridge) {
  OdometryBuffer buffer = straight({0, 20});
  EXPECT_FALSE(buffer.endsBridged());
  buffer.bridge(ms(120), kGuess);
  buffer.bridge(ms(220), {Eigen::Vector3d(2, 0, 0), ms(120)});
  EXPECT_TRUE(buffer.endsBridged());
  EXPECT_TRUE(buffer.covers(ms(220)));
  EXPECT_EQ(buffer.jumps(), 0U) << "the wheels have said nothing wrong";
  buffer.insert(sample(ms(240), SE2(0.03, 0, 0)), {Eigen::Vector3d(3, 0, 0), ms(220)});
  buffer.insert(sample(ms(260), SE2(0.05, 0, 0)));
  EXPECT_FALSE(buffer.endsBridged());
  const auto steps = buffer.steps(ms(10), ms(260));
  EXPECT_EQ(knowledge(steps), "k???k");
  EXPECT_EQ(buffer.jumps(), 1U);
  for (const int i : {1, 2, 3}) EXPECT_EQ(steps[static_cast<std::size_t>(i)].guess->velocity.x(), i);
  EXPECT_NEAR(motion({steps.back()}).x, 0.02, 1e-15);
}

TEST(OdometryBuffer, ABridgeMayBeTheBeginning) {
  OdometryBuffer buffer;
  buffer.bridge(ms(100), MotionGuess());
  buffer.bridge(ms(200), MotionGuess());
  const auto steps = buffer.steps(ms(100), ms(200));
  EXPECT_EQ(knowledge(steps), "?");
  EXPECT_EQ(steps[0].guess->since, ms(100));
}

/// One stamp from the future would make all that come after it too old.
TEST(OdometryBuffer, ASampleFarAheadWaitsForTheNext) {
  OdometryBuffer buffer = straight({0, 20});
  EXPECT_EQ(buffer.insert(sample(ms(5000), SE2(0.03, 0, 0))), Insertion::kAhead);
  EXPECT_EQ(buffer.insert(sample(ms(5000), SE2(0.03, 0, 0))), Insertion::kDuplicate);
  EXPECT_EQ(buffer.newest(), ms(20));
  EXPECT_EQ(buffer.insert(sample(ms(40), SE2(0.04, 0, 0))), Insertion::kInserted);
  EXPECT_THAT(ends(buffer.steps(ms(0), ms(40))), testing::ElementsAre(20, 40)) << "its stamp was wrong: it is gone";

  EXPECT_EQ(buffer.insert(sample(ms(6000), SE2(0.04, 0, 0))), Insertion::kAhead);
  EXPECT_EQ(buffer.insert(sample(ms(6020), SE2(0.06, 0, 0))), Insertion::kInserted);
  EXPECT_THAT(ends(buffer.steps(ms(0), ms(6020))), testing::ElementsAre(20, 40, 6000, 6020))
      << "a silence: both are in";
}

TEST(OdometryBuffer, ASampleThatWaitsIsForgottenWhereItsTimeIsBridged) {
  OdometryBuffer buffer = straight({0, 20});
  EXPECT_EQ(buffer.insert(sample(ms(5000), SE2(0.03, 0, 0))), Insertion::kAhead);
  buffer.bridge(ms(6000), kGuess);
  buffer.discardBefore(ms(6000));
  EXPECT_EQ(buffer.insert(sample(ms(9000), SE2(0.03, 0, 0))), Insertion::kAhead);
  EXPECT_EQ(buffer.insert(sample(ms(9020), SE2(0.03, 0, 0))), Insertion::kInserted);
  EXPECT_THAT(ends(buffer.steps(ms(6000), ms(9020))), testing::ElementsAre(9000, 9020));
  EXPECT_EQ(buffer.oldest(), ms(6000));
}

TEST(OdometryBuffer, RefusesStampsThatAreNoTimes) {
  OdometryBuffer buffer;
  for (const Stamp none : {Stamp(-1), Stamp::min(), Stamp::max(), Stamp(std::chrono::hours(24 * 365 * 150))}) {
    EXPECT_EQ(buffer.insert(sample(none, SE2())), Insertion::kNotFinite) << seconds(none);
  }
  EXPECT_EQ(buffer.insert(sample(Stamp(0), SE2())), Insertion::kInserted);
  EXPECT_EQ(buffer.insert(sample(std::chrono::seconds(4294967295), SE2())), Insertion::kAhead);
}

}  // namespace
}  // namespace sckf
