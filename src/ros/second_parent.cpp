#include "sckf_odometry/ros/second_parent.h"

#include "sckf_odometry/ros/conversions.h"

namespace sckf {

SecondParent::SecondParent(const NodeOptions& options)
    : published_(options.publish_tf),
      inverted_(options.invert_odom_tf),
      child_(options.invert_odom_tf ? options.odom_frame : options.base_frame) {}

void SecondParent::note(const geometry_msgs::TransformStamped& transform, const std::string& publisher,
                        bool is_static) {
  if (!published_ || stays_ || frameName(transform.child_frame_id) != child_) return;
  const std::string parent = frameName(transform.header.frame_id);
  // Old robot_state_publishers publish what is fixed on /tf: there its common name tells.
  const bool is_fixed = !inverted_ && (is_static || parent == "base_footprint");
  found_ = publisher + " publishes " + parent + " -> " + child_ +
           " on TF too, and a frame can have one parent only: set " +
           (is_fixed ? "~base_frame to \"" + parent + "\", which " + child_ + " is fixed to"
                     : "~publish_tf to false, or ~odom_frame to a name of its own and ~invert_odom_tf to true");
  stays_ = is_static;
}

std::string SecondParent::take() {
  const std::string found = found_;
  if (!stays_) found_.clear();
  return found;
}

}  // namespace sckf
