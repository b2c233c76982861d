#include "sckf_odometry/ros/input_gate.h"

#include <algorithm>
#include <optional>
#include <sstream>

#include "sckf_odometry/ros/cloud_message.h"
#include "sckf_odometry/ros/conversions.h"

namespace sckf {

namespace {

constexpr char kWrongStamp[] = "wrong stamp";
constexpr char kStray[] = "header.stamp does not go on from those before it, nor those after it from there";

std::string turnedRound(const sensor_msgs::LaserScan& scan) {
  std::ostringstream text;
  text << "angle_min is " << scan.angle_min << ", angle_max " << scan.angle_max << ", angle_increment "
       << scan.angle_increment << ": an increment that leads from the first to the last expected";
  return text.str();
}

}  // namespace

InputGate::InputGate(const NodeOptions& options, const std::string& odometry_source,
                     const std::vector<std::string>& scan_topics, Health& health, Warnings& warnings)
    : odometry_source_(odometry_source),
      scan_topics_(scan_topics),
      health_(health),
      warnings_(warnings),
      odometry_stamps_(options.time_jump),
      scan_stamps_(scan_topics.size(), StampGuard<Scan>(options.time_jump)) {}

InputGate::Scans InputGate::admit(const sensor_msgs::LaserScan::ConstPtr& message, std::size_t laser) {
  const std::string problem = isTurnedRound(*message) ? turnedRound(*message) : "";
  return admit({message->header, message}, laser, "angles turned round", problem);
}

InputGate::Scans InputGate::admit(const sensor_msgs::PointCloud2::ConstPtr& message, std::size_t laser) {
  return admit({message->header, message}, laser, "bad cloud", cloudProblem(*message));
}

InputGate::Scans InputGate::admit(const Scan& message, std::size_t laser, const std::string& kind,
                                  const std::string& problem) {
  const std_msgs::Header& header = message.header;
  health_.scanCame(laser, header.stamp, ros::Time::now());
  if (header.stamp.isZero()) {
    refuseScan(laser, "no stamp", "header.stamp is 0: the time of the first beam expected");
  } else if (header.frame_id.empty()) {
    refuseScan(laser, "no frame", "header.frame_id is empty: the laser's frame expected");
  } else if (!problem.empty()) {
    refuseScan(laser, kind, problem);
  } else {
    const Stamp stamp = toStamp(header.stamp);
    const Scans admission = scan_stamps_[laser].admit(stamp, message, now(), odometry_stamps_.newest());
    health_.scanRefused(laser, kWrongStamp, kStray, admission.dropped);
    if (admission.passed.empty()) {
      warnOfHeldBack("scan on " + scan_topics_[laser], stamp);
    } else {
      health_.scanAdmitted(laser);
    }
    return admission;
  }
  return {};
}

InputGate::Samples InputGate::admit(const nav_msgs::Odometry& message, bool uses_twist_covariance, TfInput& tf) {
  health_.odometry.came(message.header.stamp, ros::Time::now());
  if (message.header.stamp.isZero()) {
    refuseOdometry("no stamp", "header.stamp is 0: the time of the reading expected");
    return {};
  }
  std::string problem;
  std::optional<OdometrySample> sample = toOdometrySample(message, &problem);
  if (!sample) {
    refuseOdometry("no pose", problem);
    return {};
  }
  sample = tf.inBaseFrame(*sample, frameName(message.child_frame_id), &problem);
  if (!sample) {
    refuseOdometry("other frame", problem);
    return {};
  }
  problem = uses_twist_covariance ? covarianceProblem(message.twist.covariance) : "";
  if (!problem.empty()) {
    warnings_.warn("twist covariance", "odometry on " + odometry_source_ + ": twist." + problem +
                                           "; the model of the wheels is used in its place");
  }
  return admitByStamp(*sample);
}

InputGate::Samples InputGate::admit(const OdometrySample& sample) {
  health_.odometry.came(toTime(sample.stamp), ros::Time::now());
  return admitByStamp(sample);
}

InputGate::Samples InputGate::admitByStamp(const OdometrySample& sample) {
  const Samples admission = odometry_stamps_.admit(sample.stamp, sample, now());
  health_.odometry.refused(kWrongStamp, kStray, admission.dropped);
  if (admission.passed.empty()) warnOfHeldBack("odometry on " + odometry_source_, sample.stamp);
  return admission;
}

void InputGate::refuseScan(std::size_t laser, const std::string& kind, const std::string& reason) {
  health_.scanRefused(laser, kind, reason);
  warnings_.warn("scan " + kind, "scan on " + scan_topics_[laser] + " not used: " + reason);
}

void InputGate::refuseOdometry(const std::string& kind, const std::string& reason) {
  health_.odometry.refused(kind, reason);
  warnings_.warn("odometry " + kind, "odometry on " + odometry_source_ + " not used: " + reason);
}

void InputGate::restart() {
  if (odometry_stamps_.newest() > newestScan()) return odometry_stamps_.restart();
  for (StampGuard<Scan>& stamps : scan_stamps_) stamps.restart();
}

Stamp InputGate::newestScan() const {
  Stamp newest{0};
  for (const StampGuard<Scan>& stamps : scan_stamps_) newest = std::max(newest, stamps.newest());
  return newest;
}

std::size_t InputGate::scansHeldBack() const {
  std::size_t held_back = 0;
  for (const StampGuard<Scan>& stamps : scan_stamps_) held_back += stamps.heldBack();
  return held_back;
}

void InputGate::warnOfHeldBack(const std::string& what, Stamp stamp) {
  std::ostringstream text;
  text << what << " held back: header.stamp is " << toTime(stamp) << ": one about that of the newest, "
       << toTime(std::max(odometry_stamps_.newest(), newestScan()))
       << ", expected; more that go on from it are a jump of time";
  warnings_.warn(what + " held back", text.str());
}

}  // namespace sckf
