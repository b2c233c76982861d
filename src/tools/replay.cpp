// A bag through the pipeline, as fast as it goes: trajectory and what became of every scan.
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <algorithm>
#include <boost/program_options.hpp>
#include <chrono>
#include <cstdio>
#include <deque>
#include <filesystem>
#include <iostream>
#include <sstream>
#include <stdexcept>
#include <utility>
#include <vector>

#include "sckf_odometry/pipeline/scan_odometry.h"
#include "sckf_odometry/pipeline/stopwatch.h"
#include "sckf_odometry/ros/cloud_message.h"
#include "sckf_odometry/ros/conversions.h"
#include "sckf_odometry/ros/parameters.h"
#include "sckf_odometry/ros/range_message.h"
#include "sckf_odometry/ros/tf_input.h"
#include "sckf_odometry/tools/progress_bar.h"
#include "sckf_odometry/tools/refusals.h"
#include "sckf_odometry/tools/replay_arguments.h"
#include "sckf_odometry/tools/replay_statistics.h"
#include "sckf_odometry/tools/replay_tables.h"
#include "sckf_odometry/tools/topic_option.h"

namespace sckf {

namespace {

class Replay {
 public:
  Replay(const ReplayArguments& arguments, const Options& options)
      : arguments_(arguments),
        options_(options),
        pipeline_(options.pipeline),
        tf_(options.node.base_frame, options.node.use_tf_odometry ? options.node.tf_odometry_frame : "",
            Stamp(std::chrono::seconds(1))),
        trajectory_(arguments.trajectory),
        map_trajectory_(arguments.map_trajectory),
        csv_(arguments.csv),
        scan_topics_(rangeTopics(options.node)) {
    for (std::string& topic : scan_topics_) topic = resolved(topic);
    checkTopics(rangeTopics(options.node), scan_topics_);
    scans_.resize(scan_topics_.size());
    if (csv_) writeCsvHeader(csv_);
  }

  void run() {
    rosbag::Bag bag;
    open(bag);
    const auto [begin, end] = partOf(bag);
    std::vector<std::string> topics{"/tf", arguments_.odom_topic, arguments_.imu_topic, arguments_.pose_update_topic};
    topics.insert(topics.end(), scan_topics_.begin(), scan_topics_.end());
    rosbag::View view(bag, rosbag::TopicQuery("/tf_static"));  // holds ever after
    view.addQuery(bag, rosbag::TopicQuery(topics), begin, end);
    const Stopwatch stopwatch;
    ProgressBar progress(view.size());
    for (const rosbag::MessageInstance& message : view) {
      take(message);
      progress.advance();
    }
    progress.finish();
    refusals_.finish();
    checkInput();
    warnOfOthers();
    if (!waiting_.empty()) {
      std::fprintf(stderr, "%zu scans not used: no transform %s -> %s: %s\n", waiting_.size(),
                   options_.node.base_frame.c_str(), frameName(waiting_.back().message.header.frame_id).c_str(),
                   mount_problem_.c_str());
    }
    csv_.finish();
    checkOutput();
    trajectory_.finish();
    map_trajectory_.finish();
    const double log_duration = view.size() > 0 ? (view.getEndTime() - begin).toSec() : 0.0;
    statistics_.print(log_duration, stopwatch.seconds());
  }

 private:
  bool takesClouds() const { return options_.node.use_cloud_input; }

  void open(rosbag::Bag& bag) const {
    const std::string expected = arguments_.bag + ": expected a bag: ";
    if (std::filesystem::is_directory(arguments_.bag)) throw std::runtime_error(expected + "it is a folder");
    try {
      bag.open(arguments_.bag, rosbag::bagmode::Read);
    } catch (const rosbag::BagException& exception) {
      throw std::runtime_error(expected + exception.what());
    }
  }

  /// From when to when the bag is replayed.
  std::pair<ros::Time, ros::Time> partOf(const rosbag::Bag& bag) const {
    rosbag::View all(bag);
    if (all.size() == 0) throw std::runtime_error(arguments_.bag + ": no messages");
    const double duration = (all.getEndTime() - all.getBeginTime()).toSec();
    if (arguments_.start > duration) {
      std::ostringstream text;
      text << arguments_.bag << ": --start " << arguments_.start << ": no more than the bag's " << duration
           << " s expected";
      throw std::runtime_error(text.str());
    }
    const ros::Time begin = all.getBeginTime() + ros::Duration(arguments_.start);
    const bool to_end = arguments_.duration == 0.0 || arguments_.start + arguments_.duration >= duration;
    return {begin, to_end ? ros::TIME_MAX : begin + ros::Duration(arguments_.duration)};
  }

  /// Throws where nothing, or too little, has come of what the estimate is made of.
  void checkInput() const {
    for (std::size_t laser = 0; laser < scan_topics_.size(); ++laser) {
      if (scans_[laser] > 0) continue;
      throw std::runtime_error(arguments_.bag + ": no sensor_msgs/" + (takesClouds() ? "PointCloud2" : "LaserScan") +
                               " on " + scan_topics_[laser] + "; see --scan-topic");
    }
    if (odometry_used_ > 0) return;
    const std::string problem = odometryProblem();
    if (!options_.pipeline.scans_alone) throw std::runtime_error(arguments_.bag + ": " + problem);
    std::fprintf(stderr, "%s: the scans carry on alone\n", problem.c_str());
  }

  /// Of sensors that the parameters ask for, and that have said nothing in all of the bag: the robot goes on without.
  void warnOfOthers() const {
    if (arguments_.start > 0.0 || arguments_.duration > 0.0) return;
    const PipelineOptions& pipeline = options_.pipeline;
    const auto warn = [this](const char* type, const std::string& topic, const char* parameter, const char* option) {
      std::fprintf(stderr, "%s: no %s on %s, expected with %s: true; see %s: the estimate goes without\n",
                   arguments_.bag.c_str(), type, topic.c_str(), parameter, option);
    };
    if (pipeline.imu.isUsed() && imus_ == 0) {
      warn("sensor_msgs/Imu", arguments_.imu_topic, pipeline.imu.gyro ? "use_imu" : "use_imu_orientation",
           "--imu-topic");
    }
    if (pipeline.pose_updates.on && given_poses_ == 0) {
      warn("geometry_msgs/PoseWithCovarianceStamped", arguments_.pose_update_topic, "use_pose_updates",
           "--pose-update-topic");
    }
  }

  std::string odometryProblem() const {
    const NodeOptions& node = options_.node;
    if (node.use_tf_odometry) {
      return "no odometry on TF, " + node.tf_odometry_frame + " -> " + node.base_frame + " " + tf_.odometryProblem();
    }
    if (odometry_ == 0) return "no nav_msgs/Odometry on " + arguments_.odom_topic + "; see --odom-topic";
    return "none of " + std::to_string(odometry_) + " messages of odometry on " + arguments_.odom_topic + " was used";
  }

  /// Throws where a trajectory would be empty.
  void checkOutput() const {
    if (trajectory_ && poses_ == 0) {
      throw std::runtime_error(arguments_.bag + ": no pose at any scan" +
                               (last_reason_.empty() ? "" : "; the last one: " + last_reason_));
    }
    if (map_trajectory_ && map_poses_ == 0) {
      throw std::runtime_error(arguments_.bag + ": no pose in " + options_.node.map_frame +
                               ": no geometry_msgs/PoseWithCovarianceStamped that could be used on " +
                               arguments_.pose_update_topic + "; see --pose-update-topic");
    }
  }

  void take(const rosbag::MessageInstance& message) {
    if (const auto transforms = message.instantiate<tf2_msgs::TFMessage>()) {
      tf_.add(*transforms, message.getTopic() == "/tf_static");
      for (const OdometrySample& sample : tf_.takeOdometry()) addOdometry(sample);
    } else if (const auto odometry = message.instantiate<nav_msgs::Odometry>()) {
      addOdometry(*odometry);
    } else if (const auto imu = message.instantiate<sensor_msgs::Imu>()) {
      addImu(*imu);
    } else if (const auto pose = message.instantiate<geometry_msgs::PoseWithCovarianceStamped>()) {
      addPose(*pose);
    } else if (const auto cloud = message.instantiate<sensor_msgs::PointCloud2>(); cloud && takesClouds()) {
      addCloud(laserOf(message.getTopic()), cloud);
    } else if (const auto scan = message.instantiate<sensor_msgs::LaserScan>(); scan && !takesClouds()) {
      const std::size_t laser = laserOf(message.getTopic());
      ++scans_[laser];
      waiting_.push_back({laser, {scan->header, scan}});
    }
    passScansWithMount();
    process();
  }

  std::size_t laserOf(const std::string& topic) const {
    return static_cast<std::size_t>(std::find(scan_topics_.begin(), scan_topics_.end(), topic) - scan_topics_.begin());
  }

  void addCloud(std::size_t laser, const sensor_msgs::PointCloud2::ConstPtr& cloud) {
    ++scans_[laser];
    const std::string problem = cloudProblem(*cloud);
    if (problem.empty()) {
      waiting_.push_back({laser, {cloud->header, cloud}});
    } else {
      refusals_.add("cloud", toStamp(cloud->header.stamp), problem);
    }
  }

  void addOdometry(const nav_msgs::Odometry& message) {
    if (options_.node.use_tf_odometry) return;
    ++odometry_;
    std::string problem;
    auto sample = toOdometrySample(message, &problem);
    if (sample) sample = tf_.inBaseFrame(*sample, frameName(message.child_frame_id), &problem);
    if (sample) {
      addOdometry(*sample);
    } else {
      refusals_.add("odometry", toStamp(message.header.stamp), problem);
    }
  }

  void addOdometry(const OdometrySample& sample) {
    if (pipeline_.addOdometry(sample) == OdometryBuffer::Insertion::kInserted) ++odometry_used_;
  }

  void addImu(const sensor_msgs::Imu& message) {
    if (!options_.pipeline.imu.isUsed()) return;
    ++imus_;
    std::string problem;
    const auto mount = tf_.baseFrom(frameName(message.header.frame_id), &problem);
    const auto sample = mount ? toImuSample(message, *mount, options_.pipeline.imu, &problem) : std::nullopt;
    if (sample) {
      pipeline_.addImu(*sample);
    } else {
      refusals_.add("IMU", toStamp(message.header.stamp), problem);
    }
  }

  void addPose(const geometry_msgs::PoseWithCovarianceStamped& message) {
    if (!options_.pipeline.pose_updates.on) return;
    ++given_poses_;
    std::string problem;
    if (const auto pose = toGivenPose(message, options_.node.map_frame, &problem)) {
      pipeline_.addPose({pose->stamp, {pose->odom_from_base, pose->covariance}});
    } else {
      refusals_.add("pose", toStamp(message.header.stamp), problem);
    }
  }

  void passScansWithMount() {
    while (!waiting_.empty()) {
      const auto& [laser, message] = waiting_.front();
      const auto mount = tf_.baseFrom(frameName(message.header.frame_id), &mount_problem_);
      if (!mount) return;
      const MountedScan mounted = toMountedScan(message, *mount, options_.node.cloud_input);
      pipeline_.addScan(mounted.scan, mounted.base_from_laser, laser);
      waiting_.pop_front();
    }
  }

  void process() {
    const Stopwatch stopwatch;
    const std::vector<ScanReport> reports = pipeline_.process();
    const double time = stopwatch.seconds();
    for (const PoseReport& report : pipeline_.takePoseReports()) {
      if (report.reason.empty()) continue;
      refusals_.add("pose", report.stamp, toString(report.outcome) + ": " + report.reason);
    }
    for (const ScanReport& report : reports) {
      statistics_.add(report, time / static_cast<double>(reports.size()));
      if (report.estimate) ++poses_;
      if (report.in_map) ++map_poses_;
      if (!report.reason.empty()) last_reason_ = toString(report.outcome) + ": " + report.reason;
      if (trajectory_ && report.estimate) writeTumLine(trajectory_, report.stamp, report.estimate->odom_from_base);
      if (map_trajectory_ && report.in_map) writeTumLine(map_trajectory_, report.stamp, report.in_map->map_from_base);
      if (csv_) writeCsvLine(csv_, report);
    }
  }

  ReplayArguments arguments_;
  Options options_;
  ScanOdometry pipeline_;
  TfInput tf_;
  OutputFile trajectory_;
  OutputFile map_trajectory_;
  OutputFile csv_;
  ReplayStatistics statistics_;
  struct Waiting {
    std::size_t laser;
    RangeMessage message;
  };
  std::vector<std::string> scan_topics_;  // of each laser
  std::deque<Waiting> waiting_;           // for their mount
  std::string mount_problem_;
  std::vector<std::size_t> scans_;  // that came, of each laser
  std::size_t odometry_ = 0;        // messages on the topic
  std::size_t odometry_used_ = 0;
  std::size_t imus_ = 0;  // messages that the parameters ask for …
  std::size_t given_poses_ = 0;
  std::size_t poses_ = 0;  // at the scans
  std::size_t map_poses_ = 0;
  std::string last_reason_;  // of a scan that was not used
  Refusals refusals_;
};

}  // namespace

}  // namespace sckf

int main(int argc, char** argv) {
  try {
    const auto arguments = sckf::parseReplayArguments(argc, argv);
    if (arguments) sckf::Replay(*arguments, sckf::optionsFor(*arguments)).run();
    return 0;
  } catch (const boost::program_options::error& error) {
    std::cerr << "replay: " << error.what() << '\n';
    return 2;
  } catch (const std::exception& error) {
    std::cerr << "replay: " << error.what() << '\n';
    return 1;
  }
}
