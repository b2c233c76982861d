// Turns an MRPT rawlog of actions and sensory frames into a ROS bag: /scan, /odom and /tf_static.
//
// One odometry message per scan, at the scan's stamp: the wheels' increments between the scans, put end to end from the
// identity at the first scan. MRPT's ground truth, where it ships one, becomes a TUM trajectory with the bag's stamps.
#include <nav_msgs/Odometry.h>
#include <ros/time.h>
#include <rosbag/bag.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_msgs/TFMessage.h>

#include <boost/make_shared.hpp>
#include <boost/program_options.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <limits>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "sckf_odometry/core/se2.h"
#include "sckf_odometry/tools/command_line.h"
#include "sckf_odometry/tools/number_option.h"
#include "sckf_odometry/tools/output_file.h"
#include "sckf_odometry/tools/progress_bar.h"
#include "sckf_odometry/tools/rawlog_reader.h"
#include "sckf_odometry/tools/topic_option.h"

namespace {

using mrpt::obs::CObservation2DRangeScan;
using sckf::RawlogError;
using sckf::RawlogRecord;
using sckf::SE2;

struct Options {
  std::string rawlog;
  std::string bag;
  std::string ground_truth;  ///< MRPT's text file: stamp x y yaw; empty: none
  std::string tum;           ///< where the ground truth goes
  std::string sensor_label;  ///< empty: that of the first scan
  std::string scan_topic = "/scan";
  std::string odom_topic = "/odom";
  std::string odom_frame = "odom";
  std::string base_frame = "base_link";
  std::string laser_frame = "laser";
  double period = 0.1;  ///< [s] between two scans whose log has no usable stamps
};

/// Beams counterclockwise, as ROS users expect, whichever way the laser turns. What is not a reading becomes +Inf.
sensor_msgs::LaserScan toLaserScan(const RawlogRecord& record, const std::string& frame) {
  const CObservation2DRangeScan& scan = *record.scan;
  const size_t size = scan.getScanSize();
  sensor_msgs::LaserScan message;
  message.header.stamp = record.stamp;
  message.header.frame_id = frame;
  message.angle_min = -0.5f * scan.aperture;
  message.angle_max = 0.5f * scan.aperture;
  message.angle_increment = size > 1 ? scan.aperture / static_cast<float>(size - 1) : 0.0f;
  message.range_min = 0.0f;
  message.range_max = scan.maxRange;
  message.ranges.resize(size);
  if (scan.hasIntensity()) message.intensities.resize(size);
  for (size_t i = 0; i < size; ++i) {
    const size_t beam = scan.rightToLeft ? i : size - 1 - i;
    const float range = scan.getScanRange(beam);
    const bool valid = scan.getScanRangeValidity(beam) && std::isfinite(range) && range > 0.0f;
    message.ranges[i] = valid ? range : std::numeric_limits<float>::infinity();
    if (scan.hasIntensity()) message.intensities[i] = static_cast<float>(scan.getScanIntensity(beam));
  }
  return message;
}

/// Pose only; twist and covariance stay zero, as many robots publish it.
nav_msgs::Odometry toOdometry(const RawlogRecord& record, const Options& options) {
  nav_msgs::Odometry message;
  message.header.stamp = record.stamp;
  message.header.frame_id = options.odom_frame;
  message.child_frame_id = options.base_frame;
  message.pose.pose.position.x = record.odom_from_base.x;
  message.pose.pose.position.y = record.odom_from_base.y;
  message.pose.pose.orientation.z = std::sin(0.5 * record.odom_from_base.yaw);
  message.pose.pose.orientation.w = std::cos(0.5 * record.odom_from_base.yaw);
  return message;
}

tf2_msgs::TFMessage toStaticTransform(const RawlogRecord& record, const Options& options) {
  const mrpt::poses::CPose3D& base_from_laser = record.scan->sensorPose;
  mrpt::math::CQuaternionDouble rotation;
  base_from_laser.getAsQuaternion(rotation);
  geometry_msgs::TransformStamped transform;
  transform.header.stamp = record.stamp;
  transform.header.frame_id = options.base_frame;
  transform.child_frame_id = options.laser_frame;
  transform.transform.translation.x = base_from_laser.x();
  transform.transform.translation.y = base_from_laser.y();
  transform.transform.translation.z = base_from_laser.z();
  transform.transform.rotation.x = rotation.x();
  transform.transform.rotation.y = rotation.y();
  transform.transform.rotation.z = rotation.z();
  transform.transform.rotation.w = rotation.r();
  tf2_msgs::TFMessage message;
  message.transforms.push_back(transform);
  return message;
}

/// A connection that "rosbag play" publishes latched, so that a node that starts late gets the transform too.
boost::shared_ptr<ros::M_string> latchedConnection() {
  using Message = tf2_msgs::TFMessage;
  auto header = boost::make_shared<ros::M_string>();
  (*header)["type"] = ros::message_traits::datatype<Message>();
  (*header)["md5sum"] = ros::message_traits::md5sum<Message>();
  (*header)["message_definition"] = ros::message_traits::definition<Message>();
  (*header)["callerid"] = "/rawlog_to_bag";
  (*header)["latching"] = "1";
  return header;
}

/// Under another name until it is whole: a conversion that fails leaves no bag behind.
void writeBag(const std::vector<RawlogRecord>& records, const Options& options) {
  const std::string unfinished = options.bag + ".part";
  try {
    rosbag::Bag bag(unfinished, rosbag::bagmode::Write);
    const ros::Time start = records.front().stamp;
    bag.write("/tf_static", start, toStaticTransform(records.front(), options), latchedConnection());
    sckf::ProgressBar progress(records.size());
    for (const RawlogRecord& record : records) {
      bag.write(options.odom_topic, record.stamp, toOdometry(record, options));
      bag.write(options.scan_topic, record.stamp, toLaserScan(record, options.laser_frame));
      progress.advance();
    }
    progress.finish();
    bag.close();
    std::filesystem::rename(unfinished, options.bag);
  } catch (const std::exception& error) {
    std::error_code ignored;
    std::filesystem::remove(unfinished, ignored);
    throw RawlogError(options.bag + ": cannot be written: " + error.what());
  }
}

/// MRPT's ground truth, a line "stamp x y yaw" per row, by its stamp [s].
std::map<double, SE2> readGroundTruth(const std::string& path) {
  if (std::filesystem::is_directory(path)) throw RawlogError(path + ": expected a text file: it is a folder");
  std::ifstream file(path);
  if (!file) throw RawlogError(path + ": cannot be opened");
  std::map<double, SE2> truth;
  std::string line;
  for (size_t number = 1; std::getline(file, line); ++number) {
    if (line.find_first_not_of(" \t\r") == std::string::npos || line[0] == '#' || line[0] == '%') continue;
    double stamp, x, y, yaw;
    std::istringstream fields(line);
    if (!(fields >> stamp >> x >> y >> yaw)) {
      throw RawlogError(path + ":" + std::to_string(number) + ": expected a line of four numbers: stamp x y yaw");
    }
    truth[stamp] = SE2(x, y, yaw);
  }
  return truth;
}

/// The row with the scan's own stamp; in MRPT's simulated logs they agree within a microsecond.
std::optional<SE2> truthOf(const RawlogRecord& record, const std::map<double, SE2>& truth) {
  constexpr double kTolerance = 1e-4;  // [s]
  if (!record.log_stamp) return std::nullopt;
  const auto row = truth.lower_bound(record.log_stamp->toSec() - kTolerance);
  if (row == truth.end() || row->first > record.log_stamp->toSec() + kTolerance) return std::nullopt;
  return row->second;
}

/// Returns how many scans have a truth.
size_t writeGroundTruth(const std::vector<RawlogRecord>& records, const std::map<double, SE2>& truth,
                        const Options& options) {
  std::ostringstream tum;
  size_t count = 0;
  for (const RawlogRecord& record : records) {
    const auto pose = truthOf(record, truth);
    if (!pose) continue;
    char line[160];
    std::snprintf(line, sizeof line, "%u.%09u %.6f %.6f 0 0 0 %.9f %.9f\n", record.stamp.sec, record.stamp.nsec,
                  pose->x, pose->y, std::sin(0.5 * pose->yaw), std::cos(0.5 * pose->yaw));
    tum << line;
    ++count;
  }
  if (count == 0) throw RawlogError(options.ground_truth + ": no row has the stamp of a scan of " + options.rawlog);
  std::ofstream file(options.tum);
  if (!(file << tum.str()).flush()) throw RawlogError(options.tum + ": cannot be written");
  return count;
}

void convert(const Options& options) {
  std::map<double, SE2> truth;
  if (!options.ground_truth.empty()) truth = readGroundTruth(options.ground_truth);
  const sckf::Rawlog log = sckf::readRawlog(options.rawlog, options.sensor_label, options.period);
  if (!log.own_stamps) {
    std::cerr << options.rawlog << ": the scans' stamps are missing or do not increase: made up, " << options.period
              << " s apart\n";
  }
  if (log.other_scans > 0) {
    std::cerr << options.rawlog << ": left out " << log.other_scans << " scan(s) of other lasers (--sensor-label)\n";
  }
  writeBag(log.records, options);
  const double duration = (log.records.back().stamp - log.records.front().stamp).toSec();
  std::printf("%s: %zu scans, %.1f s\n", options.bag.c_str(), log.records.size(), duration);
  if (!options.ground_truth.empty()) {
    std::printf("%s: %zu poses\n", options.tum.c_str(), writeGroundTruth(log.records, truth, options));
  }
}

/// What is written replaces neither what is read nor each other.
void checkFiles(const Options& options) {
  const auto check = [](const std::string& output, const std::string& other, const std::string& what) {
    if (sckf::isSameFile(output, other)) {
      throw boost::program_options::error(output + ": expected another file than " + what);
    }
  };
  check(options.bag, options.rawlog, "the rawlog");
  check(options.bag, options.ground_truth, "that of --ground-truth");
  check(options.tum, options.rawlog, "the rawlog");
  check(options.tum, options.ground_truth, "that of --ground-truth");
  check(options.tum, options.bag, "the bag");
}

/// By their options: none is empty, and none comes twice.
void checkNames(const std::map<std::string, std::string>& names, const std::string& kind) {
  std::map<std::string, std::string> options;
  for (const auto& [option, name] : names) {
    const auto fail = [&, &option = option, &name = name](const std::string& expected) {
      throw boost::program_options::error("--" + option + " '" + name + "': expected " + expected);
    };
    if (name.empty()) fail("the name of a " + kind);
    if (kind == "topic" && name == "/tf_static") fail("another topic than that of the laser's place");
    const auto [other, is_new] = options.emplace(name, option);
    if (!is_new) fail("another " + kind + " than --" + other->second);
  }
}

/// Nothing if the help was asked for, and shown.
std::optional<Options> parseOptions(int argc, char** argv) {
  namespace po = boost::program_options;
  Options options;
  po::options_description shown("options");
  // clang-format off
  shown.add_options()("help,h", "show this help")
    ("ground-truth", po::value(&options.ground_truth), "MRPT's ground truth, a text file with lines: stamp x y yaw")
    ("tum", po::value(&options.tum), "write the ground truth of every scan to this TUM file")
    ("sensor-label", po::value(&options.sensor_label), "which laser, if there are several")
    ("period", sckf::number("period", options.period, {1e-4, 1e3, false, " s"})->default_value("0.1"),
     "seconds between scans if the log's stamps are missing or do not increase; all are then made up")
    ("scan-topic", po::value(&options.scan_topic)->default_value(options.scan_topic), "")
    ("odom-topic", po::value(&options.odom_topic)->default_value(options.odom_topic), "")
    ("odom-frame", po::value(&options.odom_frame)->default_value(options.odom_frame), "")
    ("base-frame", po::value(&options.base_frame)->default_value(options.base_frame), "")
    ("laser-frame", po::value(&options.laser_frame)->default_value(options.laser_frame), "");
  // clang-format on
  po::variables_map values =
      sckf::parseCommandLine(argc, argv, shown, {{"rawlog", &options.rawlog}, {"bag", &options.bag}});
  if (values.count("help") != 0) {
    std::cout
        << "usage: rawlog_to_bag RAWLOG BAG [options]\n\n"
           "Turns an MRPT rawlog of actions and sensory frames into a ROS bag with laser scans (no reading: +Inf),\n"
           "wheel odometry (one message per scan) and the laser's place on the robot in /tf_static.\n\n"
        << shown;
    return std::nullopt;
  }
  po::notify(values);
  if (options.rawlog.empty() || options.bag.empty()) throw po::error("a RAWLOG and a BAG are needed; see --help");
  if (options.ground_truth.empty() != options.tum.empty()) throw po::error("--ground-truth and --tum go together");
  checkFiles(options);
  options.scan_topic = sckf::topicOf("scan-topic", options.scan_topic);
  options.odom_topic = sckf::topicOf("odom-topic", options.odom_topic);
  checkNames({{"scan-topic", options.scan_topic}, {"odom-topic", options.odom_topic}}, "topic");
  checkNames(
      {{"odom-frame", options.odom_frame}, {"base-frame", options.base_frame}, {"laser-frame", options.laser_frame}},
      "frame");
  return options;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const auto options = parseOptions(argc, argv);
    if (options) convert(*options);
    return 0;
  } catch (const boost::program_options::error& error) {
    std::cerr << "rawlog_to_bag: " << error.what() << '\n';
    return 2;
  } catch (const std::exception& error) {
    std::cerr << "rawlog_to_bag: " << error.what() << '\n';
    return 1;
  }
}
