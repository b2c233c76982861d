#include "sckf_odometry/tools/replay_arguments.h"

#include <boost/program_options.hpp>
#include <iostream>
#include <limits>
#include <stdexcept>
#include <utility>

#include "sckf_odometry/ros/parameter_source.h"
#include "sckf_odometry/tools/command_line.h"
#include "sckf_odometry/tools/number_option.h"
#include "sckf_odometry/tools/output_file.h"
#include "sckf_odometry/tools/topic_option.h"

namespace sckf {

namespace {

Options optionsOf(const std::string& file) {
  const ParameterFile parameters(file);
  std::vector<std::string> remarks;
  try {
    const Options options = readOptions(parameters, &remarks);
    for (const std::string& remark : remarks) std::cerr << file << ": " << remark << "\n";
    return options;
  } catch (const std::invalid_argument& bad) {
    throw std::invalid_argument("parameter file " + file + ": " + bad.what());
  }
}

}  // namespace

std::optional<ReplayArguments> parseReplayArguments(int argc, char** argv) {
  namespace po = boost::program_options;
  constexpr double kNoEnd = std::numeric_limits<double>::max();
  ReplayArguments arguments;
  po::options_description shown("options");
  // clang-format off
  shown.add_options()("help,h", "show this help")
    ("trajectory", po::value(&arguments.trajectory), "write the poses at the scans, in the format of TUM")
    ("csv", po::value(&arguments.csv),
     "write what became of each scan; the innovation is along the directions that the scans see, in m")
    ("params", po::value(&arguments.params), "parameter file, as config/sckf_odometry.yaml")
    ("method", po::value(&arguments.method), "instead of the parameter file's method")
    ("start", number("start", arguments.start, {0.0, kNoEnd, false, " s"}), "begin so many seconds after the begin of the bag")
    ("duration", number("duration", arguments.duration, {0.0, kNoEnd, true, " s"}), "take no more than so many seconds of it")
    ("scan-topic", po::value(&arguments.scan_topics),
     "instead of the parameter file's scan_topics; again for each further laser")
    ("odom-topic", po::value(&arguments.odom_topic)->default_value(arguments.odom_topic), "")
    ("map-trajectory", po::value(&arguments.map_trajectory), "write the poses in map at the scans, in the format of TUM")
    ("pose-update-topic", po::value(&arguments.pose_update_topic)->default_value(arguments.pose_update_topic),
     "with the parameter use_pose_updates")
    ("imu-topic", po::value(&arguments.imu_topic)->default_value(arguments.imu_topic), "with the parameter use_imu");
  // clang-format on
  po::variables_map values = parseCommandLine(argc, argv, shown, {{"bag", &arguments.bag}});
  if (values.count("help") != 0) {
    std::cout << "usage: replay BAG --trajectory OUT.tum [options]\n\n"
                 "Runs a bag through the very pipeline that the nodelet runs, as fast as it goes.\n\n"
              << shown;
    return std::nullopt;
  }
  po::notify(values);
  if (arguments.bag.empty()) throw po::error("a BAG is needed; see --help");
  if (arguments.trajectory.empty() && arguments.csv.empty()) throw po::error("--trajectory or --csv is needed");
  const std::vector<std::pair<std::string, std::string>> outputs{
      {"--trajectory", arguments.trajectory}, {"--csv", arguments.csv}, {"--map-trajectory", arguments.map_trajectory}};
  std::vector<std::pair<std::string, std::string>> files = outputs;
  files.insert(files.end(), {{"the bag", arguments.bag}, {"--params", arguments.params}});
  for (const auto& [option, path] : outputs) {
    for (const auto& [other, same] : files) {
      if (option != other && isSameFile(path, same)) {
        throw po::error(option + " " + path + ": expected another file than " + other);
      }
    }
  }
  arguments.odom_topic = topicOf("odom-topic", arguments.odom_topic);
  arguments.imu_topic = topicOf("imu-topic", arguments.imu_topic);
  arguments.pose_update_topic = topicOf("pose-update-topic", arguments.pose_update_topic);
  for (const std::string& topic : arguments.scan_topics) topicOf("scan-topic", topic);  // messages name it as given
  return arguments;
}

Options optionsFor(const ReplayArguments& arguments) {
  Options options;
  if (!arguments.params.empty()) options = optionsOf(arguments.params);
  if (!arguments.method.empty()) options.pipeline.method = arguments.method;
  if (!arguments.scan_topics.empty()) options.node.scan_topics = arguments.scan_topics;
  options.pipeline.lasers = options.node.scan_topics.size();
  if (!arguments.map_trajectory.empty() && !options.pipeline.pose_updates.on) {
    throw boost::program_options::error("--map-trajectory: use_pose_updates: true expected, in the file of --params");
  }
  return options;
}

}  // namespace sckf
