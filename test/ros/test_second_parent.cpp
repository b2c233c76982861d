// Who else publishes a parent of the estimate's frame.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "sckf_odometry/ros/second_parent.h"
#include "transforms.h"

namespace sckf::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

/// What is told if a node publishes one parent of one frame on /tf.
std::string told(const NodeOptions& options, const std::string& parent, const std::string& child,
                 const std::string& publisher) {
  SecondParent second(options);
  second.note(transform(parent, child), publisher, false);
  return second.take();
}

TEST(SecondParent, IsToldOnceForEachTimeThatItIsSeen) {
  SecondParent second{NodeOptions()};
  EXPECT_EQ(second.take(), "");
  second.note(transform("odom", "base_link"), "/driver", false);
  EXPECT_THAT(second.take(),
              AllOf(HasSubstr("/driver publishes odom -> base_link on TF too"), HasSubstr("~publish_tf to false")));
  EXPECT_EQ(second.take(), "") << "the driver may have ended";
}

TEST(SecondParent, OnTfStaticStays) {
  SecondParent second{NodeOptions()};
  second.note(transform("/base_footprint", "/base_link"), "/robot_state_publisher", true);
  second.note(transform("odom", "base_link"), "/driver", false);
  const std::string told = second.take();
  EXPECT_THAT(told, HasSubstr("~base_frame to \"base_footprint\", which base_link is fixed to"));
  EXPECT_EQ(second.take(), told);
}

TEST(SecondParent, IsFixedOnTfTooIfItIsTheFootprint) {
  EXPECT_THAT(told({}, "base_footprint", "base_link", "/robot_state_publisher"),
              HasSubstr("~base_frame to \"base_footprint\""));
}

TEST(SecondParent, IsNoneOfAnotherFrame) {
  SecondParent second{NodeOptions()};
  second.note(transform("base_link", "laser"), "/mounts", true);
  second.note(transform("map", "odom"), "/amcl", false);
  EXPECT_EQ(second.take(), "");
}

TEST(SecondParent, MattersOnlyIfTheTransformIsPublished) {
  NodeOptions options;
  options.publish_tf = false;
  EXPECT_EQ(told(options, "odom", "base_link", "/driver"), "");
}

TEST(SecondParent, IsOneOfOdomWhereTheTransformIsInverted) {
  NodeOptions options;
  options.invert_odom_tf = true;
  EXPECT_EQ(told(options, "odom", "base_link", "/driver"), "") << "base_link has no parent from here then";
  EXPECT_THAT(told(options, "map", "odom", "/amcl"),
              AllOf(HasSubstr("/amcl publishes map -> odom"), HasSubstr("~publish_tf to false")));
}

}  // namespace
}  // namespace sckf::test
