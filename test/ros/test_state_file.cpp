#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdio>
#include <fstream>
#include <sstream>

#include "sckf_odometry/ros/state_file.h"
#include "temporary_folder.h"
#include "text_matchers.h"

namespace sckf {
namespace {

constexpr Stamp kStamp = std::chrono::seconds(1000);

SavedPose somePose() {
  SavedPose pose{"odom", "base_link", kStamp, SE2(1.0 / 3.0, -2.5, 3.1), Eigen::Matrix3d::Zero()};
  pose.covariance << 0.3, 0.1, 0.02, 0.1, 0.4, 0.03, 0.02, 0.03, 1.0 / 7.0;
  return pose;
}

class StateFileTest : public testing::Test {
 protected:
  void fill(const std::string& content) { std::ofstream(path_) << content; }

  std::string content() const {
    std::ostringstream text;
    text << std::ifstream(path_).rdbuf();
    return text.str();
  }

  /// What is wrong with the file.
  std::string refusal() const {
    std::string problem;
    return file_.read(&problem) ? "read" : problem;
  }

  NodeOptions options() const {
    NodeOptions options;
    options.state_file = path_;
    return options;
  }

  TemporaryFolder folder_;
  std::string path_ = folder_.file("state.yaml");
  StateFile file_{path_};
};

TEST_F(StateFileTest, WhatIsWrittenIsReadToTheLastDigit) {
  std::string problem;
  ASSERT_TRUE(file_.write(somePose(), &problem)) << problem;
  const auto read = file_.read(&problem);
  ASSERT_TRUE(read) << problem;
  EXPECT_EQ(read->odom_frame, "odom");
  EXPECT_EQ(read->base_frame, "base_link");
  EXPECT_EQ(read->stamp, kStamp);
  EXPECT_EQ(read->odom_from_base.vector(), somePose().odom_from_base.vector());
  EXPECT_EQ(read->covariance, somePose().covariance);
  EXPECT_FALSE(std::ifstream(path_ + ".part"));
}

TEST_F(StateFileTest, NoFileIsNoProblem) { EXPECT_EQ(refusal(), ""); }

TEST_F(StateFileTest, AFileThatIsNoneIsNamedWithWhatIsExpected) {
  for (const std::string bad : {"", "no: pose\n", "[unclosed",
                                "\x7f"
                                "ELF",
                                "odom_frame: odom\nbase_frame: base_link\n"}) {
    fill(bad);
    EXPECT_TRUE(contains(refusal(), path_)) << bad;
    EXPECT_TRUE(contains(refusal(), "pose [x, y, yaw], covariance [3 x 3] expected")) << bad;
  }
}

TEST_F(StateFileTest, AFolderIsNamed) {
  ASSERT_EQ(mkdir(path_.c_str(), 0700), 0);
  EXPECT_EQ(refusal(), path_ + ": Is a directory");
}

TEST_F(StateFileTest, NumbersThatAreNoPoseAreRefused) {
  const std::string frames = "odom_frame: odom\nbase_frame: base_link\nstamp: 5\n";
  const std::string zeros = "covariance: [0, 0, 0, 0, 0, 0, 0, 0, 0]\n";
  fill(frames + "pose: [1, 2, 3]\n" + zeros);
  EXPECT_EQ(refusal(), "read");
  fill(frames + "pose: [.nan, 2, 3]\n" + zeros);
  EXPECT_TRUE(contains(refusal(), "pose is (nan, 2, 3): expected finite values"));
  fill(frames + "pose: [1e300, 2, 3]\n" + zeros);
  EXPECT_TRUE(contains(refusal(), "pose is (1e+300, 2, 3): expected finite values"));
  fill(frames + "pose: [1, 2]\n" + zeros);
  EXPECT_TRUE(contains(refusal(), "3 numbers"));
  fill(frames + "pose: [1, 2, 3]\ncovariance: [-1, 0, 0, 0, 1, 0, 0, 0, 1]\n");
  EXPECT_TRUE(contains(refusal(), "covariance"));
  fill(frames + "pose: [1, 2, 3]\ncovariance: [1, 5, 0, 0, 1, 0, 0, 0, 1]\n");
  EXPECT_TRUE(contains(refusal(), "covariance"));
}

TEST_F(StateFileTest, WhereNothingCanBeWrittenTheFileIsNamed) {
  std::string problem;
  EXPECT_FALSE(StateFile("/nowhere/state.yaml").write(somePose(), &problem));
  EXPECT_TRUE(contains(problem, "/nowhere/state.yaml"));
}

TEST_F(StateFileTest, AWriteThatFailsLeavesTheFileAsItWas) {
  std::string problem;
  ASSERT_TRUE(file_.write(somePose(), &problem));
  const std::string before = content();
  ASSERT_EQ(mkdir((path_ + ".part").c_str(), 0700), 0);
  EXPECT_FALSE(file_.write({"odom", "base_link", kStamp, SE2(), Eigen::Matrix3d::Zero()}, &problem));
  std::remove((path_ + ".part").c_str());
  EXPECT_EQ(content(), before);
}

TEST_F(StateFileTest, TheKeeperTakesUpWhatItKept) {
  PoseKeeper(options()).keep({kStamp, somePose().odom_from_base, somePose().covariance, Twist()});
  PoseKeeper keeper(options());
  const auto taken = keeper.takeUp(kStamp + std::chrono::seconds(30));
  ASSERT_TRUE(taken);
  EXPECT_EQ(taken->odom_from_base.vector(), somePose().odom_from_base.vector());
  EXPECT_FALSE(keeper.takeUp(kStamp)) << "twice";
}

TEST_F(StateFileTest, TheKeeperLeavesWhatIsOldOrOfAnotherTimeOrForgotten) {
  PoseKeeper(options()).keep({kStamp, SE2(), Eigen::Matrix3d::Zero(), Twist()});
  EXPECT_FALSE(PoseKeeper(options()).takeUp(kStamp + std::chrono::seconds(61)));
  EXPECT_FALSE(PoseKeeper(options()).takeUp(kStamp - std::chrono::seconds(5)));
  EXPECT_TRUE(PoseKeeper(options()).takeUp(kStamp + std::chrono::seconds(59)));
  NodeOptions impatient = options();
  impatient.state_max_age = 10.0;
  EXPECT_FALSE(PoseKeeper(impatient).takeUp(kStamp + std::chrono::seconds(11)));
  EXPECT_TRUE(PoseKeeper(impatient).takeUp(kStamp + std::chrono::seconds(9)));
  PoseKeeper forgetful(options());
  forgetful.forget();
  EXPECT_FALSE(forgetful.takeUp(kStamp));
}

TEST_F(StateFileTest, TheKeeperLeavesThePoseOfOtherFrames) {
  PoseKeeper(options()).keep({kStamp, SE2(), Eigen::Matrix3d::Zero(), Twist()});
  NodeOptions other = options();
  other.odom_frame = "sckf_odom";
  EXPECT_FALSE(PoseKeeper(other).takeUp(kStamp));
}

TEST_F(StateFileTest, TheKeeperDoesNotOverwriteWhatMayStillBeTakenUp) {
  PoseKeeper(options()).keep({kStamp, somePose().odom_from_base, somePose().covariance, Twist()});
  const std::string before = content();
  PoseKeeper(options()).keep({kStamp + kStamp, SE2(), Eigen::Matrix3d::Zero(), Twist()});
  EXPECT_EQ(content(), before);
}

TEST_F(StateFileTest, WithoutANameNothingIsKept) {
  PoseKeeper keeper((NodeOptions()));
  keeper.keep({kStamp, SE2(), Eigen::Matrix3d::Zero(), Twist()});
  EXPECT_FALSE(std::ifstream(path_));
  EXPECT_FALSE(keeper.takeUp(kStamp));
}

}  // namespace
}  // namespace sckf
