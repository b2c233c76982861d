// Whether somebody else publishes the transform of the estimate, too.
#pragma once

#include <geometry_msgs/TransformStamped.h>

#include <string>

#include "sckf_odometry/ros/parameters.h"

namespace sckf {

/// A frame has one parent on TF. Where another node gives one to the frame that the estimate is published for, the
/// robot jumps to and fro for all who listen.
class SecondParent {
 public:
  explicit SecondParent(const NodeOptions& options);

  /// A transform that is not of this node: the name of the node that publishes it, and whether it does on /tf_static.
  void note(const geometry_msgs::TransformStamped& transform, const std::string& publisher, bool is_static);

  /// Who it is and what to do, of what has been noted since this was last asked, or ever if it is static; empty if it
  /// is nobody.
  std::string take();

 private:
  bool published_;     // the estimate's transform is
  bool inverted_;      // base_link -> odom
  std::string child_;  // of the estimate's transform
  std::string found_;
  bool stays_ = false;  // it is on /tf_static
};

}  // namespace sckf
