#include "sckf_odometry/ros/sckf_odometry_node.h"

#include <ros/console.h>

#include <algorithm>
#include <sstream>
#include <stdexcept>

#include "sckf_odometry/ros/conversions.h"

namespace sckf {

namespace {

constexpr char kLogger[] = "sckf_odometry";
constexpr std::size_t kConfirmations = 3;  // so many stamps in a row are a jump in time and not a wrong stamp

Stamp toDuration(double seconds) { return std::chrono::duration_cast<Stamp>(std::chrono::duration<double>(seconds)); }

/// With odometry on TF, base_frame has a parent there already.
NodeOptions withOdometryOnTf(NodeOptions options) {
  if (!options.use_tf_odometry) return options;
  options.invert_odom_tf = true;
  if (options.publish_tf && options.odom_frame == options.tf_odometry_frame) {
    options.publish_tf = false;
    ROS_WARN_STREAM_NAMED(kLogger, "not publishing TF: odometry is read from TF as "
                                       << options.tf_odometry_frame << " -> " << options.base_frame
                                       << ". Set ~odom_frame to a name of its own, and the estimate is published as "
                                       << options.base_frame << " -> that frame.");
  }
  return options;
}

Options readOptions(const ros::NodeHandle& private_nh) {
  std::vector<std::string> unknown;
  Options options = readOptions(ParameterServer(private_nh), &unknown);
  for (const std::string& name : unknown) {
    ROS_WARN_STREAM_NAMED(kLogger, "unknown parameter " << private_nh.resolveName(name)
                                                        << ": no effect; the names are in config/sckf_odometry.yaml");
  }
  options.node = withOdometryOnTf(options.node);
  return options;
}

}  // namespace

ScKfOdometryNode::ScKfOdometryNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh)
    : options_(readOptions(private_nh)),
      pipeline_(std::make_unique<ScanOdometry>(options_.pipeline)),
      tf_(options_.node.base_frame, options_.node.use_tf_odometry ? options_.node.tf_odometry_frame : "",
          toDuration(options_.node.time_jump)),
      publisher_(nh, options_.node),
      debug_view_(nh, options_.node),
      diagnostics_(nh, private_nh, private_nh.getNamespace()),
      scan_topic_(nh.resolveName("scan")),
      odometry_topic_(nh.resolveName("odom")) {
  subscribe(nh);
  startTimers(nh);
}

void ScKfOdometryNode::subscribe(ros::NodeHandle& nh) {
  const auto queue = static_cast<uint32_t>(options_.node.queue_size);
  // Without it, odometry comes in lumps after the scans that it belongs to.
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  using TransformEvent = const ros::MessageEvent<const tf2_msgs::TFMessage>&;
  const auto subscribeTf = [&](const std::string& topic, bool is_static) {
    const boost::function<void(TransformEvent)> callback = [this, is_static](TransformEvent event) {
      onTransforms(event, is_static);
    };
    subscribers_.push_back(nh.subscribe<TransformEvent>(topic, queue, callback, ros::VoidConstPtr(), hints));
  };
  subscribeTf("/tf_static", true);
  subscribeTf("/tf", false);
  if (!options_.node.use_tf_odometry) {
    subscribers_.push_back(nh.subscribe("odom", queue, &ScKfOdometryNode::onOdometry, this, hints));
  }
  subscribers_.push_back(nh.subscribe("scan", queue, &ScKfOdometryNode::onScan, this, hints));
}

void ScKfOdometryNode::startTimers(ros::NodeHandle& nh) {
  if (options_.node.visualization_rate > 0.0) {
    view_timer_ = nh.createWallTimer(ros::WallDuration(1.0 / options_.node.visualization_rate),
                                     &ScKfOdometryNode::onViewTimer, this);
  }
  diagnostics_.setHardwareID("none");
  diagnostics_.add("odometry", this, &ScKfOdometryNode::diagnose);
  const boost::function<void(const ros::WallTimerEvent&)> update = [this](const ros::WallTimerEvent&) {
    diagnostics_.force_update();
  };
  diagnostic_timer_ = nh.createWallTimer(ros::WallDuration(1.0), update);
}

template <typename Callback>
void ScKfOdometryNode::guarded(const Callback& callback) {
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    callback();
  } catch (const std::exception& exception) {
    ROS_ERROR_STREAM_THROTTLE_NAMED(1.0, kLogger, "message dropped: " << exception.what());
  }
}

void ScKfOdometryNode::onScan(const sensor_msgs::LaserScan::ConstPtr& message) {
  guarded([&] {
    if (message->header.stamp.isZero()) return refuseScan("header.stamp is 0: the time of the first beam expected");
    if (message->header.frame_id.empty()) return refuseScan("header.frame_id is empty: the laser's frame expected");
    scans_without_mount_.push_back(message);
    advance();
  });
}

void ScKfOdometryNode::onOdometry(const nav_msgs::Odometry::ConstPtr& message) {
  guarded([&] {
    if (message->header.stamp.isZero()) return refuseOdometry("header.stamp is 0: the time of the reading expected");
    std::string problem;
    std::optional<OdometrySample> sample = toOdometrySample(*message, &problem);
    if (sample) sample = tf_.inBaseFrame(*sample, frameName(message->child_frame_id), &problem);
    if (!sample) return refuseOdometry(problem);
    addOdometry(*sample);
  });
}

void ScKfOdometryNode::onTransforms(const ros::MessageEvent<const tf2_msgs::TFMessage>& event, bool is_static) {
  guarded([&] {
    tf_.add(*event.getConstMessage(), is_static);
    warnOfSecondParent(event);
    if (options_.node.use_tf_odometry) {
      for (const OdometrySample& sample : tf_.takeOdometry()) addOdometry(sample);
    }
    if (!scans_without_mount_.empty()) advance();
  });
}

void ScKfOdometryNode::onViewTimer(const ros::WallTimerEvent&) {
  guarded([&] { publisher_.publishViews(); });
}

void ScKfOdometryNode::addOdometry(const OdometrySample& sample) {
  if (isHeldBack(sample)) return;
  newest_odometry_ = std::max(newest_odometry_, sample.stamp);
  ++counts_.odometry;
  switch (pipeline_->addOdometry(sample)) {
    case OdometryBuffer::Insertion::kInserted:
      break;
    case OdometryBuffer::Insertion::kDuplicate:
      ++counts_.odometry_refused;
      break;
    case OdometryBuffer::Insertion::kTooOld:
      refuseOdometry("it came after a scan that was taken later");
      break;
    case OdometryBuffer::Insertion::kNotFinite:
      refuseOdometry("its pose is not finite");
      break;
    case OdometryBuffer::Insertion::kAhead:
      break;  // the next one tells whether its stamp is right
  }
  advance();
  publisher_.addWheels(sample);
}

bool ScKfOdometryNode::isHeldBack(const OdometrySample& sample) {
  const Stamp back = toDuration(options_.node.time_jump);
  const auto isNear = [back](Stamp stamp, Stamp other) { return stamp + back >= other && stamp <= other + 10 * back; };
  if (newest_odometry_ == Stamp(0) || isNear(sample.stamp, newest_odometry_)) {
    held_back_.clear();
    return false;
  }
  if (!held_back_.empty() && !isNear(sample.stamp, held_back_.back().stamp)) held_back_.clear();
  held_back_.push_back(sample);
  if (held_back_.size() >= kConfirmations) {
    acceptHeldBack();
  } else {
    std::ostringstream text;
    text << "its stamp differs by " << seconds(sample.stamp - newest_odometry_) << " s from the newest";
    refuseOdometry(text.str());
  }
  return true;
}

void ScKfOdometryNode::acceptHeldBack() {
  const std::vector<OdometrySample> samples = std::move(held_back_);
  held_back_.clear();
  const double jump = seconds(samples.front().stamp - newest_odometry_);
  newest_odometry_ = samples.front().stamp;
  if (jump < 0.0) {
    ROS_WARN_STREAM_NAMED(kLogger, "time went back by " << -jump << " s: the estimate starts again");
    restart();
  }
  for (const OdometrySample& sample : samples) addOdometry(sample);
}

void ScKfOdometryNode::restart() {
  pipeline_ = std::make_unique<ScanOdometry>(options_.pipeline);
  publisher_.restart();
  if (!options_.node.use_tf_odometry) tf_.clear();  // there it has noticed by itself, and has begun anew already
}

void ScKfOdometryNode::refuseScan(const std::string& reason) {
  ++counts_.scans_refused;
  warnings_.warn("scan", "scan on " + scan_topic_ + " not used: " + reason);
}

void ScKfOdometryNode::refuseOdometry(const std::string& reason) {
  ++counts_.odometry_refused;
  const std::string source = options_.node.use_tf_odometry ? "TF" : odometry_topic_;
  warnings_.warn("odometry", "odometry on " + source + " not used: " + reason);
}

void ScKfOdometryNode::advance() {
  passScansWithMount();
  const ros::SteadyTime begin = ros::SteadyTime::now();
  const std::vector<ScanReport> reports = pipeline_->process();
  const double time = (ros::SteadyTime::now() - begin).toSec();
  for (const ScanReport& report : reports) account(report);
  if (!reports.empty()) {
    counts_.scans_timed += reports.size();
    counts_.scan_time += time;
    counts_.scan_time_max = std::max(counts_.scan_time_max, time / static_cast<double>(reports.size()));
  }
  if (const auto latest = pipeline_->latest()) publisher_.publish(*latest);
}

void ScKfOdometryNode::passScansWithMount() {
  std::deque<sensor_msgs::LaserScan::ConstPtr> waiting;
  for (const auto& message : scans_without_mount_) {
    const std::string frame = frameName(message->header.frame_id);
    if (const auto base_from_laser = tf_.baseFrom(frame, &mount_problem_)) {
      pipeline_->addScan(toScan(*message), *base_from_laser);
    } else {
      waiting.push_back(message);
    }
  }
  scans_without_mount_ = std::move(waiting);
  if (scans_without_mount_.size() <= static_cast<std::size_t>(options_.pipeline.max_waiting_scans)) return;
  refuseScan("its mount is not known: " + mount_problem_);
  scans_without_mount_.pop_front();
}

void ScKfOdometryNode::account(const ScanReport& report) {
  ++counts_.scans[report.outcome];
  last_scan_ = toString(report.outcome) + (report.reason.empty() ? "" : ": " + report.reason);
  if (!report.reason.empty()) warnings_.warn("scan", "scan on " + scan_topic_ + " not used: " + last_scan_);
  debug_view_.show(report);
  if (!report.estimate) return;
  publisher_.publish(*report.estimate);
  publisher_.publishScan(*report.estimate, report.scan.get());
}

void ScKfOdometryNode::warnOfSecondParent(const ros::MessageEvent<const tf2_msgs::TFMessage>& event) {
  const NodeOptions& node = options_.node;
  if (!node.publish_tf || event.getPublisherName() == ros::this_node::getName()) return;
  const std::string& child = node.invert_odom_tf ? node.odom_frame : node.base_frame;
  for (const auto& transform : event.getConstMessage()->transforms) {
    if (frameName(transform.child_frame_id) != child) continue;
    warnings_.warn("second parent", event.getPublisherName() + " publishes " + frameName(transform.header.frame_id) +
                                        " -> " + child + " on TF too, and a frame can have one parent only: set " +
                                        "~publish_tf to false, or ~odom_frame to a name of its own and " +
                                        "~invert_odom_tf to true");
  }
}

std::string ScKfOdometryNode::waitingFor() const {
  const NodeOptions& node = options_.node;
  if (counts_.odometry == 0 && node.use_tf_odometry) {
    return "odometry on TF, " + node.tf_odometry_frame + " -> " + node.base_frame + " " + tf_.odometryProblem();
  }
  if (counts_.odometry == 0) return "odometry on " + odometry_topic_;
  if (!scans_without_mount_.empty()) return "the mount of the laser: " + mount_problem_;
  if (counts_.scans.empty()) return "scans on " + scan_topic_;
  return "";
}

void ScKfOdometryNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  guarded([&] {
    using Status = diagnostic_msgs::DiagnosticStatus;
    const std::string waiting = waitingFor();
    if (!waiting.empty()) {
      status.summary(Status::WARN, "waiting for " + waiting);
      warnings_.warn("waiting", "waiting for " + waiting);
    } else {
      status.summary(Status::OK, "estimating");
    }
    std::size_t scans = counts_.scans_refused;
    for (const auto& [outcome, count] : counts_.scans) {
      status.add("scans: " + toString(outcome), count);
      scans += count;
    }
    status.add("scans: refused", counts_.scans_refused);
    status.add("scans: together", scans);
    status.add("scans: waiting for their mount", scans_without_mount_.size());
    status.add("last scan", last_scan_);
    status.add("odometry: messages", counts_.odometry);
    status.add("odometry: refused", counts_.odometry_refused);
    if (counts_.scans_timed == 0) return;
    status.addf("time of a scan, mean [ms]", "%.3f",
                1e3 * counts_.scan_time / static_cast<double>(counts_.scans_timed));
    status.addf("time of a scan, longest [ms]", "%.3f", 1e3 * counts_.scan_time_max);
  });
}

}  // namespace sckf
