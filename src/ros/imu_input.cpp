#include "sckf_odometry/ros/imu_input.h"

#include <algorithm>
#include <sstream>

#include "sckf_odometry/ros/conversions.h"

namespace sckf {

ImuInput::ImuInput(const ImuOptions& options, const std::string& topic, double time_jump, Health& health,
                   Warnings& warnings)
    : options_(options), topic_(topic), health_(health), warnings_(warnings), stamps_(time_jump) {}

std::vector<ImuSample> ImuInput::admit(const sensor_msgs::Imu& message, Stamp newest_odometry, TfInput& tf) {
  const std_msgs::Header& header = message.header;
  health_.imu.came(header.stamp, ros::Time::now());
  if (header.stamp.isZero()) return refuse("no stamp", "header.stamp is 0: the time of the reading expected");
  if (header.frame_id.empty()) return refuse("no frame", "header.frame_id is empty: the IMU's frame expected");
  mount_problem_.clear();
  const auto base_from_imu = tf.baseFrom(frameName(header.frame_id), &mount_problem_);
  if (!base_from_imu) return refuse("no mount", "its mount is not known: " + mount_problem_);
  std::string problem;
  const auto sample = toImuSample(message, *base_from_imu, options_, &problem);
  if (!sample) return refuse("no reading", problem);
  const auto admission = stamps_.admit(sample->stamp, *sample, now(), newest_odometry);
  health_.imu.refused("wrong stamp", "header.stamp does not go on from those before it", admission.dropped);
  if (admission.passed.empty()) {
    std::ostringstream text;
    text << "IMU on " << topic_ << " held back: header.stamp is " << header.stamp << ": one about "
         << toTime(std::max(stamps_.newest(), newest_odometry)) << " expected";
    warnings_.warn("imu held back", text.str());
  }
  return admission.passed;
}

void ImuInput::ended(ImuBuffer::Insertion insertion, Stamp stamp, Stamp newest_odometry) {
  switch (insertion) {
    case ImuBuffer::Insertion::kInserted:
      return health_.imu.used();
    case ImuBuffer::Insertion::kDuplicate:
      refuse("duplicate", duplicateOf(stamp));
      return;
    case ImuBuffer::Insertion::kTooOld:
      refuse("too late", afterAScan(stamp, newest_odometry));
      return;
    case ImuBuffer::Insertion::kNotFinite:
      refuse("no reading", "its values are not finite, or larger than any can be");
      return;
  }
}

std::vector<ImuSample> ImuInput::refuse(const std::string& kind, const std::string& reason) {
  health_.imu.refused(kind, reason);
  warnings_.warn("imu " + kind, "IMU on " + topic_ + " not used: " + reason);
  return {};
}

}  // namespace sckf
