#include "sckf_odometry/ros/sckf_odometry_node.h"

#include <ros/console.h>

#include <algorithm>
#include <sstream>
#include <stdexcept>

#include "sckf_odometry/Status.h"
#include "sckf_odometry/ros/constants.h"
#include "sckf_odometry/ros/conversions.h"

namespace sckf {

namespace {

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

std::vector<std::string> resolved(const ros::NodeHandle& nh, const std::vector<std::string>& topics) {
  std::vector<std::string> names;
  for (const std::string& topic : topics) names.push_back(nh.resolveName(topic));
  checkTopics(topics, names);
  return names;
}

Options readOptions(const ros::NodeHandle& private_nh) {
  std::vector<std::string> warnings;
  Options options = readOptions(ParameterServer(private_nh), &warnings);
  for (const std::string& warning : warnings) {
    ROS_WARN_STREAM_NAMED(kLogger, private_nh.getNamespace() << ": " << warning);
  }
  options.node = withOdometryOnTf(options.node);
  return options;
}

}  // namespace

ScKfOdometryNode::ScKfOdometryNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh)
    : options_(readOptions(private_nh)),
      scan_topics_(resolved(nh, rangeTopics(options_.node))),
      odometry_source_(options_.node.use_tf_odometry ? "TF" : nh.resolveName("odom")),
      pipeline_(std::make_unique<ScanOdometry>(options_.pipeline)),
      tf_(options_.node.base_frame, options_.node.use_tf_odometry ? options_.node.tf_odometry_frame : "",
          toDuration(options_.node.time_jump)),
      publisher_(nh, options_.node),
      second_parent_(options_.node),
      map_publisher_(nh, options_),
      debug_view_(nh, options_.node),
      status_publisher_(nh.advertise<sckf_odometry::Status>("status", kPublisherQueue)),
      health_(odometry_source_, scan_topics_),
      pose_keeper_(options_.node),
      gate_(options_.node, odometry_source_, scan_topics_, health_, warnings_),
      imu_(options_.pipeline.imu, nh.resolveName("imu"), options_.node.time_jump, health_, warnings_),
      pose_updates_(options_.node, nh.resolveName("pose_update"), health_, warnings_),
      diagnostics_(nh, private_nh, private_nh.getNamespace()),
      services_(nh, private_nh, serviceActions()),
      reconfigure_(private_nh, options_, [this](const Options& options) { onOptions(options); }) {
  startTimers(nh);
  subscribe(nh);
}

ScKfOdometryNode::~ScKfOdometryNode() {
  const std::lock_guard<std::mutex> lock(mutex_);
  // Nothing is said of a failure: where the process ends, roscpp's log may have ended already.
  if (const auto latest = pipeline_->latest()) pose_keeper_.keep(*latest);
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
  if (options_.pipeline.imu.isUsed()) {
    subscribers_.push_back(nh.subscribe("imu", queue, &ScKfOdometryNode::onImu, this, hints));
  }
  if (options_.pipeline.pose_updates.on) {
    subscribers_.push_back(nh.subscribe("pose_update", queue, &ScKfOdometryNode::onPoseUpdate, this, hints));
  }
  for (std::size_t laser = 0; laser < scan_topics_.size(); ++laser) {
    using ScanPtr = sensor_msgs::LaserScan::ConstPtr;
    using CloudPtr = sensor_msgs::PointCloud2::ConstPtr;
    const boost::function<void(const ScanPtr&)> on_scan = [this, laser](const ScanPtr& scan) { onScan(laser, scan); };
    const boost::function<void(const CloudPtr&)> on_cloud = [this, laser](const CloudPtr& cloud) {
      onCloud(laser, cloud);
    };
    const std::string& topic = scan_topics_[laser];
    subscribers_.push_back(options_.node.use_cloud_input
                               ? nh.subscribe<sensor_msgs::PointCloud2>(topic, queue, on_cloud, {}, hints)
                               : nh.subscribe<sensor_msgs::LaserScan>(topic, queue, on_scan, {}, hints));
  }
}

void ScKfOdometryNode::startTimers(ros::NodeHandle& nh) {
  const auto every = [&nh](double period, const std::function<void()>& action) {
    const boost::function<void(const ros::WallTimerEvent&)> callback = [action](const ros::WallTimerEvent&) {
      action();
    };
    return nh.createWallTimer(ros::WallDuration(period), callback);
  };
  diagnostics_.setHardwareID("none");
  diagnostics_.add("odometry", this, &ScKfOdometryNode::diagnose);
  timers_.push_back(every(1.0, [this] { diagnostics_.force_update(); }));
  timers_.push_back(every(1.0, [this] { guarded([this] { keepPose(); }); }));
  view_timer_ = every(1.0, [this] { guarded([this] { publisher_.publishViews(); }); });
  setViewRate();
}

Services::Actions ScKfOdometryNode::serviceActions() {
  Services::Actions actions;
  actions.reset = [this] { guarded([this] { reset(); }); };
  actions.set_pose = [this](const geometry_msgs::PoseWithCovarianceStamped& message) {
    Services::Actions::Answer answer{false, "it failed, see the log"};
    guarded([&] { answer = setPose(message); });
    return answer;
  };
  actions.pause = [this](bool paused) { guarded([this, paused] { pause(paused); }); };
  return actions;
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

void ScKfOdometryNode::onScan(std::size_t laser, const sensor_msgs::LaserScan::ConstPtr& message) {
  guarded([&] { addScans(laser, gate_.admit(message, laser)); });
}

void ScKfOdometryNode::onCloud(std::size_t laser, const sensor_msgs::PointCloud2::ConstPtr& message) {
  guarded([&] { addScans(laser, gate_.admit(message, laser)); });
}

void ScKfOdometryNode::onOdometry(const nav_msgs::Odometry::ConstPtr& message) {
  guarded([&] { addOdometry(gate_.admit(*message, options_.pipeline.prefer_twist_covariance, tf_)); });
}

void ScKfOdometryNode::onImu(const sensor_msgs::Imu::ConstPtr& message) {
  guarded([&] {
    for (const ImuSample& sample : imu_.admit(*message, gate_.newestOdometry(), tf_)) {
      paused_ ? imu_.ended("paused") : imu_.ended(pipeline_->addImu(sample), sample.stamp, gate_.newestOdometry());
    }
    advance();
  });
}

void ScKfOdometryNode::onPoseUpdate(const geometry_msgs::PoseWithCovarianceStamped::ConstPtr& message) {
  guarded([&] {
    const std::optional<PoseUpdate> pose = pose_updates_.admit(*message);
    if (!pose) return;
    if (paused_) return health_.pose_updates.ended("paused");
    pipeline_->addPose(*pose);
    health_.poseUpdatePassed();
    advance();
  });
}

void ScKfOdometryNode::onTransforms(const ros::MessageEvent<const tf2_msgs::TFMessage>& event, bool is_static) {
  guarded([&] {
    const std::string& publisher = event.getPublisherName();
    for (const geometry_msgs::TransformStamped& transform : event.getConstMessage()->transforms) {
      // What is published from here is known. Other nodelets have the same name, that of their manager.
      if (publisher == ros::this_node::getName() && publisher_.takeSent(transform)) continue;
      tf_.add(transform, is_static);
      second_parent_.note(transform, publisher, is_static);
    }
    if (options_.node.use_tf_odometry) {
      for (const OdometrySample& sample : tf_.takeOdometry()) addOdometry(gate_.admit(sample));
    }
    if (!scans_without_mount_.empty()) advance();
  });
}

void ScKfOdometryNode::onOptions(const Options& options) {
  guarded([&] {
    pipeline_->setOptions(options.pipeline);
    options_ = options;
    setViewRate();
  });
}

void ScKfOdometryNode::setViewRate() {
  const double rate = options_.node.visualization_rate;
  if (rate <= 0.0) return view_timer_.stop();
  view_timer_.setPeriod(ros::WallDuration(1.0 / rate));
  view_timer_.start();
}

void ScKfOdometryNode::addScans(std::size_t laser, const InputGate::Scans& admission) {
  // Without odometry it is the scans that tell the time.
  if (admission.time_jump < Stamp(0) && pipeline_->onScansAlone()) followTime(admission.time_jump);
  if (paused_) return health_.scans.ended("paused", admission.passed.size());
  for (const RangeMessage& scan : admission.passed) scans_without_mount_.add(laser, scan);
  advance();
}

void ScKfOdometryNode::addOdometry(const InputGate::Samples& admission) {
  if (admission.time_jump != Stamp(0)) followTime(admission.time_jump);
  for (const OdometrySample& sample : admission.passed) addOdometry(sample);
}

void ScKfOdometryNode::addOdometry(const OdometrySample& sample) {
  if (paused_) return health_.odometry.ended("paused");
  if (!pipeline_->latest()) {
    if (const auto saved = pose_keeper_.takeUp(sample.stamp)) {
      pipeline_->setPose(saved->odom_from_base, saved->covariance, sample.stamp);
    }
  }
  switch (pipeline_->addOdometry(sample)) {
    case OdometryBuffer::Insertion::kInserted:
      health_.odometry.used();
      break;
    case OdometryBuffer::Insertion::kDuplicate:
      return gate_.refuseOdometry("duplicate", duplicateOf(sample.stamp));
    case OdometryBuffer::Insertion::kTooOld:
      return gate_.refuseOdometry("too late", afterAScan(sample.stamp, gate_.newestOdometry()));
    case OdometryBuffer::Insertion::kNotFinite:
      return gate_.refuseOdometry("no pose", "its pose is not finite");
    case OdometryBuffer::Insertion::kAhead:
      return health_.odometry.ended("ahead");  // the next one tells whether its stamp is right
  }
  advance();
  publisher_.addWheels(sample);
}

void ScKfOdometryNode::advance() {
  passScansWithMount();
  const std::vector<ScanReport> reports = pipeline_->process();
  accountPoses(!reports.empty());
  for (const ScanReport& report : reports) account(report);
  if (paused_) return;
  if (const auto latest = pipeline_->latest()) publisher_.publish(*latest);
}

void ScKfOdometryNode::passScansWithMount() {
  for (const auto& [scan, base_from_sensor] : scans_without_mount_.take(tf_)) {
    const MountedScan mounted = toMountedScan(scan.message, base_from_sensor, options_.node.cloud_input);
    pipeline_->addScan(mounted.scan, mounted.base_from_laser, scan.laser);
    health_.scanPassed();
  }
  const auto most = static_cast<std::size_t>(options_.pipeline.max_waiting_scans);
  while (const std::optional<std::size_t> laser = scans_without_mount_.giveUpBeyond(most)) {
    gate_.refuseScan(*laser, "no mount", "its mount is not known: " + scans_without_mount_.problem());
  }
}

void ScKfOdometryNode::account(const ScanReport& report) {
  health_.scanTaken(report);
  auto status = toStatus(report, options_.pipeline.method, options_.node.odom_frame, ros::Time::now());
  status.scan_topic = scan_topics_[report.laser];
  status_publisher_.publish(status);
  if (!report.reason.empty()) {
    const std::string outcome = toString(report.outcome);
    warnings_.warn("scan " + outcome,
                   "scan on " + scan_topics_[report.laser] + " not used: " + outcome + ": " + report.reason);
  }
  warnOfNoReturn(report);
  warnOfSkew(report);
  debug_view_.show(report);
  if (!report.estimate) return;
  publisher_.publish(*report.estimate);
  publisher_.publishScan(*report.estimate, report.scan.get());
  if (report.in_map) map_publisher_.publish(*report.in_map);
}

void ScKfOdometryNode::accountPoses(bool scans_were_taken) {
  for (const PoseReport& report : pipeline_->takePoseReports()) {
    pose_updates_.ended(report);
    // Scans tell more, and later: without them the poses themselves tell when.
    if (report.in_map && !scans_were_taken) map_publisher_.publish(*report.in_map);
  }
}

void ScKfOdometryNode::warnOfNoReturn(const ScanReport& report) {
  if (!report.no_return.isFound()) return;
  const std::string& topic = scan_topics_[report.laser];
  std::ostringstream text;
  text << "scan on " << topic << ": its driver writes " << report.no_return.value()
       << " m where the laser has seen nothing, and a larger range_max: readings of that and more are not used; "
          "expected "
          "range_max in the message, or ~range_max, to be "
       << report.no_return.value();
  warnings_.warnOnce("no return " + topic, text.str());
}

void ScKfOdometryNode::warnOfSkew(const ScanReport& report) {
  const std::string text =
      "scan on " + scan_topics_[report.laser] + " used as it is, not deskewed: " + report.deskewing_problem;
  if (report.deskewing == Deskewing::kNotTold) warnings_.warnOnce("scan " + toString(report.deskewing), text);
  if (report.deskewing == Deskewing::kRefused) warnings_.warn("scan " + toString(report.deskewing), text);
}

void ScKfOdometryNode::begin(const SE2& odom_from_base, const Eigen::Matrix3d& covariance, const std::string& reason,
                             const Found& before) {
  health_.pipelineDropped(reason, pipeline_->odometryJumps());
  health_.scans.ended(reason, scans_without_mount_.size());
  scans_without_mount_.clear();
  pipeline_ = std::make_unique<ScanOdometry>(options_.pipeline, odom_from_base, covariance, before);
}

void ScKfOdometryNode::followTime(Stamp jump) {
  health_.timeJumped(seconds(jump));
  if (jump > Stamp(0)) {
    ROS_WARN_STREAM_NAMED(kLogger, "time went ahead by " << seconds(jump) << " s: the estimate goes on");
    return;
  }
  ROS_WARN_STREAM_NAMED(kLogger, "time went back by " << -seconds(jump) << " s: the estimate starts again");
  begin(SE2(), Eigen::Matrix3d::Zero(), "dropped, time went back");
  gate_.restart();
  imu_.restart();
  map_publisher_.restart();
  publisher_.restart();
  if (!options_.node.use_tf_odometry) tf_.clear();  // there it has noticed by itself, and has begun anew already
}

void ScKfOdometryNode::reset() {
  ROS_INFO_NAMED(kLogger, "reset: the estimate starts again");
  pose_keeper_.forget();
  tf_.forgetMounts();
  begin(SE2(), Eigen::Matrix3d::Zero(), "dropped, reset");
  publisher_.clearViews();
}

Services::Actions::Answer ScKfOdometryNode::setPose(const geometry_msgs::PoseWithCovarianceStamped& message) {
  std::string problem;
  const std::optional<GivenPose> pose = toGivenPose(message, options_.node.odom_frame, &problem);
  if (!pose) {
    ROS_WARN_STREAM_NAMED(kLogger, "set_pose refused: " << problem);
    return {false, problem};
  }
  pose_keeper_.forget();
  const bool of_its_stamp = pipeline_->setPose(pose->odom_from_base, pose->covariance, pose->stamp);
  publisher_.clearViews();
  ROS_INFO_STREAM_NAMED(kLogger, "pose set to " << pose->odom_from_base.vector().transpose());
  if (of_its_stamp || message.header.stamp.isZero()) return {true, ""};
  std::ostringstream remark;
  remark << "the pose holds from now on: of the motion since its stamp, " << message.header.stamp
         << " s, nothing is known; expected 0, or one that the odometry of the last ~max_scan_delay covers";
  ROS_WARN_STREAM_NAMED(kLogger, "set_pose: " << remark.str());
  return {true, remark.str()};
}

void ScKfOdometryNode::pause(bool paused) {
  if (paused == paused_) return;
  ROS_INFO_STREAM_NAMED(kLogger, (paused ? "paused" : "resumed"));
  paused_ = paused;
  keepPose();
  // It goes on from where it is, whatever the wheels say then.
  if (const auto latest = pipeline_->latest()) {
    begin(latest->odom_from_base, latest->covariance, "paused", pipeline_->found());
  }
}

void ScKfOdometryNode::keepPose() {
  const std::optional<Estimate> latest = pipeline_->latest();
  const std::string problem = latest ? pose_keeper_.keep(*latest) : "";
  if (!problem.empty()) warnings_.warn("state file", "~state_file not written: " + problem);
}

std::string ScKfOdometryNode::waitingFor() const {
  const NodeOptions& node = options_.node;
  if (!health_.odometry.anyUsed() && node.use_tf_odometry) {
    return "odometry on TF, " + node.tf_odometry_frame + " -> " + node.base_frame + " " + tf_.odometryProblem();
  }
  if (!health_.odometry.anyUsed()) return "odometry on " + odometry_source_;
  if (!scans_without_mount_.empty()) return "the mount of the laser: " + scans_without_mount_.problem();
  const std::string silent = health_.topicNotHeard();
  if (!silent.empty()) return "scans on " + silent;
  if (!imu_.mountProblem().empty()) return "the mount of the IMU: " + imu_.mountProblem();
  if (options_.pipeline.imu.isUsed() && !health_.imu.anyUsed()) return "the IMU on " + imu_.topic();
  if (options_.pipeline.pose_updates.on && !health_.pose_updates.anyUsed()) {
    return "absolute poses on " + pose_updates_.topic();
  }
  return "";
}

void ScKfOdometryNode::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  guarded([&] {
    using Level = diagnostic_msgs::DiagnosticStatus;
    Health::Conditions conditions;
    conditions.waiting_for = waitingFor();
    conditions.second_parent = second_parent_.take();
    conditions.paused = paused_;
    conditions.scans_alone = pipeline_->onScansAlone();
    conditions.odometry_jumps = pipeline_->odometryJumps();
    conditions.odometry_held_back = gate_.odometryHeldBack();
    conditions.scans_held_back = gate_.scansHeldBack();
    conditions.scans_without_mount = scans_without_mount_.size();
    conditions.imu_held_back = imu_.heldBack();
    conditions.newest_odometry = gate_.newestOdometry();
    for (const Health::Finding& finding : health_.report(conditions, options_, ros::Time::now(), status)) {
      finding.level == Level::ERROR ? warnings_.error(finding.kind, finding.text)
                                    : warnings_.warn(finding.kind, finding.text);
    }
  });
}

}  // namespace sckf
