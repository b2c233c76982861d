#include "sckf_odometry/ros/tf_input.h"

#include <tf2/exceptions.h>

#include "sckf_odometry/ros/conversions.h"

namespace sckf {

namespace {

constexpr std::size_t kMaxWaiting = 500;  // stamps of odometry that wait for the rest of the chain to base_frame
constexpr int kBackwards = 3;             // so many in a row are a jump in time and not a message that came late

}  // namespace

TfInput::TfInput(const std::string& base_frame, const std::string& odometry_frame, Stamp time_jump)
    : base_frame_(base_frame), odometry_frame_(odometry_frame), time_jump_(time_jump) {}

void TfInput::add(const tf2_msgs::TFMessage& message, bool is_static) {
  for (const geometry_msgs::TransformStamped& transform : message.transforms) add(transform, is_static);
}

void TfInput::add(const geometry_msgs::TransformStamped& transform, bool is_static) {
  const bool is_odometry = !is_static && frameName(transform.header.frame_id) == odometry_frame_;
  if (is_odometry) noteOdometryStamp(transform.header.stamp);
  buffer_.setTransform(transform, "sckf_odometry", is_static);
}

void TfInput::forgetMounts() { mounts_.clear(); }

void TfInput::clear() {
  buffer_.clear();
  odometry_stamps_.clear();
  newest_odometry_ = ros::Time();
}

void TfInput::noteOdometryStamp(const ros::Time& stamp) {
  if (toStamp(stamp) + time_jump_ < toStamp(newest_odometry_)) {
    if (++backwards_ < kBackwards) return;
    clear();
  }
  backwards_ = 0;
  newest_odometry_ = std::max(newest_odometry_, stamp);
  if (!odometry_stamps_.empty() && odometry_stamps_.back() == stamp) return;
  odometry_stamps_.push_back(stamp);
  if (odometry_stamps_.size() > kMaxWaiting) odometry_stamps_.pop_front();
}

std::optional<Eigen::Isometry3d> TfInput::baseFrom(const std::string& frame, std::string* problem) {
  if (frame == base_frame_) return Eigen::Isometry3d::Identity();
  const auto known = mounts_.find(frame);
  if (known != mounts_.end()) return known->second;
  try {
    return mounts_[frame] = toIsometry(buffer_.lookupTransform(base_frame_, frame, ros::Time(0)).transform);
  } catch (const tf2::TransformException& exception) {
    if (problem != nullptr) {
      *problem = "no transform " + base_frame_ + " -> " + frame + " on TF: " + exception.what();
    }
    return std::nullopt;
  }
}

std::optional<OdometrySample> TfInput::inBaseFrame(const OdometrySample& sample, const std::string& child_frame,
                                                   std::string* problem) {
  if (child_frame.empty()) return sample;
  if (const auto base_from_child = baseFrom(child_frame, problem)) {
    return moved(sample, toPlanar(base_from_child->inverse()));
  }
  *problem = "child_frame_id is \"" + child_frame + "\", ~base_frame \"" + base_frame_ + "\" expected; " + *problem;
  return std::nullopt;
}

std::vector<OdometrySample> TfInput::takeOdometry() {
  std::vector<OdometrySample> samples;
  std::size_t taken = 0;  // with those before it: what was older than the rest of the chain never becomes known
  for (std::size_t i = 0; i < odometry_stamps_.size(); ++i) {
    const ros::Time& stamp = odometry_stamps_[i];
    std::string problem;  // each time a new one: tf2 appends to what it is given
    if (!buffer_.canTransform(odometry_frame_, base_frame_, stamp, &problem)) {
      odometry_problem_ = problem;
      continue;
    }
    const auto pose =
        toPlanar(buffer_.lookupTransform(odometry_frame_, base_frame_, stamp).transform, &odometry_problem_);
    taken = i + 1;
    if (pose) samples.push_back({toStamp(stamp), *pose, std::nullopt});
  }
  odometry_stamps_.erase(odometry_stamps_.begin(), odometry_stamps_.begin() + static_cast<std::ptrdiff_t>(taken));
  if (!samples.empty()) odometry_problem_.clear();
  return samples;
}

}  // namespace sckf
