// rawlog_to_bag, run as a person runs it, on rawlogs made here and on the two that MRPT ships.
// RAWLOG_TO_BAG is the path of the executable under test.
#include <gtest/gtest.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CRawlog.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/LaserScan.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;
using mrpt::obs::CActionRobotMovement2D;
using mrpt::obs::CObservation2DRangeScan;
using mrpt::obs::CRawlog;
using mrpt::obs::CSensoryFrame;
using mrpt::poses::CPose2D;
using mrpt::poses::CPose3D;

constexpr double kStart = 1.2e9;
constexpr float kInf = std::numeric_limits<float>::infinity();

template <typename Message>
std::vector<Message> messages(const rosbag::Bag& bag, const std::string& topic) {
  std::vector<Message> all;
  for (const rosbag::MessageInstance& instance : rosbag::View(bag, rosbag::TopicQuery(topic))) {
    const auto message = instance.instantiate<Message>();
    EXPECT_TRUE(message) << "a message of another type on " << topic;
    if (message) all.push_back(*message);
  }
  return all;
}

std::string contents(const fs::path& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

size_t lines(const fs::path& path) {
  const std::string text = contents(path);
  return static_cast<size_t>(std::count(text.begin(), text.end(), '\n'));
}

/// Four beams over 90 degrees, of which the last has no reading.
CObservation2DRangeScan makeScan(double stamp, bool right_to_left = true) {
  CObservation2DRangeScan scan;
  const std::vector<float> ranges = {1.0f, 2.0f, 3.0f, 0.0f};
  const std::vector<char> validity = {1, 1, 1, 0};
  scan.loadFromVectors(ranges.size(), ranges.data(), validity.data());
  scan.aperture = static_cast<float>(M_PI / 2);
  scan.rightToLeft = right_to_left;
  scan.maxRange = 30.0f;
  scan.sensorPose = CPose3D(0.5, -0.1, 0.3, M_PI / 2, 0.0, M_PI);  // to the left, upside down
  scan.sensorLabel = "FRONT";
  if (stamp > 0.0) scan.timestamp = mrpt::Clock::fromDouble(stamp);
  return scan;
}

void addScan(CRawlog& rawlog, const CObservation2DRangeScan& scan) {
  CSensoryFrame frame;
  frame.insert(CObservation2DRangeScan::Create(scan));
  rawlog.insert(frame);
}

void addMovement(CRawlog& rawlog, const CPose2D& increment) {
  CActionRobotMovement2D movement;
  movement.computeFromOdometry(increment, CActionRobotMovement2D::TMotionModelOptions());
  rawlog.insert(movement);
}

/// Twice 1 m ahead and a quarter turn to the left, between three scans.
CRawlog makeRawlog(double second_stamp = kStart + 0.2) {
  CRawlog rawlog;
  addMovement(rawlog, CPose2D(7.0, 0.0, 0.0));  // before the first scan: no part of the odometry
  addScan(rawlog, makeScan(kStart));
  addMovement(rawlog, CPose2D(1.0, 0.0, M_PI / 2));
  addScan(rawlog, makeScan(second_stamp, false));
  addMovement(rawlog, CPose2D(1.0, 0.0, M_PI / 2));
  addScan(rawlog, makeScan(kStart + 0.5));
  return rawlog;
}

class RawlogToBag : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "rawlog_to_bag_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder = name;
  }
  void TearDown() override { fs::remove_all(folder); }

  fs::path save(const CRawlog& rawlog) const {
    EXPECT_TRUE(rawlog.saveToRawLogFile((folder / "log.rawlog").string()));
    return folder / "log.rawlog";
  }

  /// Returns the exit code; what was said on stderr is in `complaint`.
  int run(const fs::path& rawlog, const std::string& more = "") {
    const std::string command = std::string(RAWLOG_TO_BAG) + " '" + rawlog.string() + "' " + bag_path().string() + " " +
                                more + " > /dev/null 2> " + (folder / "stderr").string();
    const int status = std::system(command.c_str());
    complaint = contents(folder / "stderr");
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  fs::path bag_path() const { return folder / "log.bag"; }
  void openBag() { bag.open(bag_path().string(), rosbag::bagmode::Read); }

  fs::path folder;
  std::string complaint;
  rosbag::Bag bag;
};

TEST_F(RawlogToBag, ScansCarryAnglesAndReadings) {
  ASSERT_EQ(run(save(makeRawlog())), 0) << complaint;
  EXPECT_EQ(complaint, "");
  openBag();
  const auto scans = messages<sensor_msgs::LaserScan>(bag, "/scan");
  ASSERT_EQ(scans.size(), 3u);
  EXPECT_EQ(scans[0].header.frame_id, "laser");
  EXPECT_NEAR(scans[0].angle_min, -M_PI / 4, 1e-6);
  EXPECT_NEAR(scans[0].angle_max, M_PI / 4, 1e-6);
  EXPECT_NEAR(scans[0].angle_increment, M_PI / 6, 1e-6);
  EXPECT_FLOAT_EQ(scans[0].range_max, 30.0f);
  EXPECT_EQ(scans[0].ranges, (std::vector<float>{1.0f, 2.0f, 3.0f, kInf}));
}

TEST_F(RawlogToBag, AScanTakenClockwiseIsTurnedRound) {
  ASSERT_EQ(run(save(makeRawlog())), 0) << complaint;
  openBag();
  const auto scan = messages<sensor_msgs::LaserScan>(bag, "/scan").at(1);
  EXPECT_GT(scan.angle_increment, 0.0f);
  EXPECT_EQ(scan.ranges, (std::vector<float>{kInf, 3.0f, 2.0f, 1.0f}));
}

TEST_F(RawlogToBag, OdometryIsPutEndToEndFromTheFirstScan) {
  ASSERT_EQ(run(save(makeRawlog())), 0) << complaint;
  openBag();
  const auto odometry = messages<nav_msgs::Odometry>(bag, "/odom");
  const auto scans = messages<sensor_msgs::LaserScan>(bag, "/scan");
  ASSERT_EQ(odometry.size(), 3u);
  const std::vector<std::vector<double>> expected = {{0.0, 0.0, 0.0}, {1.0, 0.0, M_PI / 2}, {1.0, 1.0, M_PI}};
  for (size_t i = 0; i < odometry.size(); ++i) {
    const auto& pose = odometry[i].pose.pose;
    EXPECT_EQ(odometry[i].header.frame_id, "odom");
    EXPECT_EQ(odometry[i].child_frame_id, "base_link");
    EXPECT_EQ(odometry[i].header.stamp, scans[i].header.stamp);
    EXPECT_NEAR(pose.position.x, expected[i][0], 1e-9);
    EXPECT_NEAR(pose.position.y, expected[i][1], 1e-9);
    EXPECT_NEAR(std::abs(pose.orientation.z), std::sin(expected[i][2] / 2), 1e-9);
    EXPECT_NEAR(std::abs(pose.orientation.w), std::cos(expected[i][2] / 2), 1e-9);
  }
}

TEST_F(RawlogToBag, WithoutARawReadingTheEstimatedMovementCounts) {
  CRawlog rawlog;
  addScan(rawlog, makeScan(kStart));
  CActionRobotMovement2D movement;
  movement.computeFromOdometry(CPose2D(0.25, 0.0, 0.0), CActionRobotMovement2D::TMotionModelOptions());
  movement.rawOdometryIncrementReading = CPose2D(9.0, 9.0, 0.0);
  movement.estimationMethod = CActionRobotMovement2D::emScan2DMatching;
  rawlog.insert(movement);
  addScan(rawlog, makeScan(kStart + 0.1));
  ASSERT_EQ(run(save(rawlog)), 0) << complaint;
  openBag();
  EXPECT_NEAR(messages<nav_msgs::Odometry>(bag, "/odom").at(1).pose.pose.position.x, 0.25, 1e-9);
}

TEST_F(RawlogToBag, TheLasersPlaceIsAStaticTransformThatLateNodesGet) {
  ASSERT_EQ(run(save(makeRawlog())), 0) << complaint;
  openBag();
  const auto statics = messages<tf2_msgs::TFMessage>(bag, "/tf_static");
  ASSERT_EQ(statics.size(), 1u);
  ASSERT_EQ(statics[0].transforms.size(), 1u);
  const auto& transform = statics[0].transforms[0];
  EXPECT_EQ(transform.header.frame_id, "base_link");
  EXPECT_EQ(transform.child_frame_id, "laser");
  EXPECT_NEAR(transform.transform.translation.x, 0.5, 1e-9);
  EXPECT_NEAR(transform.transform.translation.y, -0.1, 1e-9);
  EXPECT_NEAR(transform.transform.translation.z, 0.3, 1e-9);
  // Yaw 90° after roll 180°: the quaternion (x, y, z, w) = (cos 45°, sin 45°, 0, 0), up to sign.
  const auto& q = transform.transform.rotation;
  const double half = std::sqrt(0.5);
  EXPECT_NEAR(std::abs(q.x * half + q.y * half), 1.0, 1e-9);
  rosbag::View view(bag, rosbag::TopicQuery("/tf_static"));
  EXPECT_EQ(view.getConnections().at(0)->header->at("latching"), "1");
}

TEST_F(RawlogToBag, StampsAreTheLogs) {
  ASSERT_EQ(run(save(makeRawlog())), 0) << complaint;
  openBag();
  const auto scans = messages<sensor_msgs::LaserScan>(bag, "/scan");
  EXPECT_NEAR(scans[0].header.stamp.toSec(), kStart, 1e-6);
  EXPECT_NEAR(scans[1].header.stamp.toSec(), kStart + 0.2, 1e-6);
  EXPECT_NEAR(scans[2].header.stamp.toSec(), kStart + 0.5, 1e-6);
}

TEST_F(RawlogToBag, StampsAreMadeUpWhereTheLogHasNoneOrTheyGoBack) {
  for (const double second_stamp : {0.0, kStart - 1.0, kStart}) {
    ASSERT_EQ(run(save(makeRawlog(second_stamp)), "--period 0.25"), 0) << complaint;
    EXPECT_NE(complaint.find("made up, 0.25 s apart"), std::string::npos) << complaint;
    openBag();
    const auto scans = messages<sensor_msgs::LaserScan>(bag, "/scan");
    EXPECT_NEAR(scans[1].header.stamp.toSec(), kStart + 0.25, 1e-6);
    EXPECT_NEAR(scans[2].header.stamp.toSec(), kStart + 0.5, 1e-6);
    bag.close();
  }
}

TEST_F(RawlogToBag, OneLaserOfSeveralIsConverted) {
  CObservation2DRangeScan rear = makeScan(kStart);
  rear.sensorLabel = "REAR";
  rear.maxRange = 8.0f;
  CRawlog rawlog;
  for (int i = 0; i < 2; ++i) {
    CSensoryFrame frame;
    frame.insert(CObservation2DRangeScan::Create(makeScan(kStart + i)));
    rear.timestamp = mrpt::Clock::fromDouble(kStart + i);
    frame.insert(CObservation2DRangeScan::Create(rear));
    rawlog.insert(frame);
    addMovement(rawlog, CPose2D(0.1, 0.0, 0.0));
  }
  ASSERT_EQ(run(save(rawlog)), 0) << complaint;
  EXPECT_NE(complaint.find("left out 2 scan(s) of other lasers"), std::string::npos) << complaint;
  ASSERT_EQ(run(folder / "log.rawlog", "--sensor-label REAR"), 0) << complaint;
  openBag();
  const auto scans = messages<sensor_msgs::LaserScan>(bag, "/scan");
  ASSERT_EQ(scans.size(), 2u);
  EXPECT_FLOAT_EQ(scans[0].range_max, 8.0f);
}

TEST_F(RawlogToBag, GroundTruthIsMatchedByStampAndWrittenWithTheBagsStamps) {
  std::ofstream(folder / "truth.txt") << "1200000000.000001 0.5 1.5 0.0\n"
                                      << "1200000000.300000 9.0 9.0 9.0\n"
                                      << "1200000000.500000 2.5 3.5 3.141593\n";
  const std::string options =
      "--ground-truth " + (folder / "truth.txt").string() + " --tum " + (folder / "truth.tum").string();
  ASSERT_EQ(run(save(makeRawlog()), options), 0) << complaint;
  std::ifstream tum(folder / "truth.tum");
  double stamp, x, y, z, qx, qy, qz, qw;
  ASSERT_TRUE(tum >> stamp >> x >> y >> z >> qx >> qy >> qz >> qw);
  EXPECT_DOUBLE_EQ(stamp, kStart);
  EXPECT_DOUBLE_EQ(x, 0.5);
  EXPECT_DOUBLE_EQ(y, 1.5);
  ASSERT_TRUE(tum >> stamp >> x >> y >> z >> qx >> qy >> qz >> qw);
  EXPECT_DOUBLE_EQ(stamp, kStart + 0.5);
  EXPECT_NEAR(std::abs(qz), 1.0, 1e-6);
  EXPECT_FALSE(tum >> stamp);
}

TEST_F(RawlogToBag, WhatCannotBeConvertedIsNamedAndLeavesNoBag) {
  const auto expect = [this](const fs::path& rawlog, const std::string& what, const std::string& more = "") {
    EXPECT_EQ(run(rawlog, more), 1);
    EXPECT_NE(complaint.find(what), std::string::npos) << complaint;
    EXPECT_FALSE(fs::exists(bag_path()));
    EXPECT_FALSE(fs::exists(bag_path().string() + ".part"));
  };
  expect(folder / "none.rawlog", "none.rawlog: no such file");
  expect(folder, folder.string() + ": expected a rawlog: it is a folder");
  expect(save(makeRawlog()), folder.string() + ": expected a text file: it is a folder",
         "--tum " + (folder / "truth.tum").string() + " --ground-truth " + folder.string());
  std::ofstream(folder / "text.rawlog") << "this is not a rawlog, only a line of text\n";
  expect(folder / "text.rawlog", "text.rawlog: not an MRPT rawlog");

  CRawlog no_scans;
  addMovement(no_scans, CPose2D(1.0, 0.0, 0.0));
  expect(save(no_scans), "no 2D laser scans");
  expect(save(makeRawlog()), "no 2D laser scans with the label 'REAR'", "--sensor-label REAR");

  CRawlog no_odometry;
  addScan(no_odometry, makeScan(kStart));
  expect(save(no_odometry), "no odometry");

  CRawlog observations_only;
  observations_only.insert(CObservation2DRangeScan::Create(makeScan(kStart)));
  expect(save(observations_only), "a bare observation: only rawlogs of actions and sensory frames");

  CRawlog moved_laser = makeRawlog();
  CObservation2DRangeScan moved = makeScan(kStart + 0.6);
  moved.sensorPose.x(0.6);
  addScan(moved_laser, moved);
  expect(save(moved_laser), "the laser's pose on the robot changes");
}

TEST_F(RawlogToBag, ADamagedLogIsNotTakenForAShortOne) {
  CRawlog rawlog;
  for (int i = 0; i < 200; ++i) {
    addScan(rawlog, makeScan(kStart + 0.1 * i));
    addMovement(rawlog, CPose2D(0.01 * i, 0.0, 0.001 * i));
  }
  const fs::path path = save(rawlog);
  fs::resize_file(path, fs::file_size(path) / 2);
  EXPECT_EQ(run(path), 1);
  EXPECT_NE(complaint.find("is damaged, or cut off"), std::string::npos) << complaint;
}

TEST_F(RawlogToBag, UsageErrorsAreTold) {
  EXPECT_EQ(run(save(makeRawlog()), "--tum x.tum"), 2);
  EXPECT_NE(complaint.find("--ground-truth and --tum go together"), std::string::npos) << complaint;
  EXPECT_EQ(run(save(makeRawlog()), "--nonsense"), 2);
}

TEST_F(RawlogToBag, OptionsThatCannotBeAreRefusedWithWhatIsExpected) {
  const fs::path rawlog = save(makeRawlog());
  const auto expect = [&](const std::string& option, const std::string& value, const std::string& what) {
    EXPECT_EQ(run(rawlog, option + " '" + value + "'"), 2) << option << " " << value;
    EXPECT_NE(complaint.find(what), std::string::npos) << complaint;
    EXPECT_FALSE(fs::exists(bag_path()));
  };
  for (const std::string value : {"0", "-1", "foo", "inf", "1e300", "1e-300"}) {
    expect("--period", value, "--period " + value + ": expected 0.0001 to 1000 s");
  }
  for (const std::string option : {"--scan-topic", "--odom-topic"}) {
    for (const std::string value : {"", "/", "a b", "~scan"}) {
      expect(option, value, option + " '" + value + "': expected the name of a topic");
    }
    expect(option, "/tf_static", "expected another topic than that of the laser's place");
  }
  expect("--scan-topic", "odom", "--scan-topic '/odom': expected another topic than --odom-topic");
  for (const std::string option : {"--odom-frame", "--base-frame", "--laser-frame"}) {
    expect(option, "", option + " '': expected the name of a frame");
  }
  expect("--odom-frame", "base_link", "--odom-frame 'base_link': expected another frame than --base-frame");
}

TEST_F(RawlogToBag, ATopicHasItsSlashInTheBag) {
  ASSERT_EQ(run(save(makeRawlog()), "--scan-topic front/scan --odom-topic wheels"), 0) << complaint;
  openBag();
  EXPECT_EQ(messages<sensor_msgs::LaserScan>(bag, "/front/scan").size(), 3u);
  EXPECT_EQ(messages<nav_msgs::Odometry>(bag, "/wheels").size(), 3u);
}

TEST_F(RawlogToBag, WhatIsWrittenReplacesNothingThatIsReadNorTheBag) {
  const fs::path rawlog = save(makeRawlog());
  const fs::path truth = folder / "truth.txt";
  std::ofstream(truth) << kStart << " 0 0 0\n";
  const std::string before = contents(rawlog);
  for (const auto& [tum, what] : std::map<fs::path, std::string>{
           {rawlog, "the rawlog"}, {truth, "that of --ground-truth"}, {bag_path(), "the bag"}}) {
    EXPECT_EQ(run(rawlog, "--ground-truth " + truth.string() + " --tum " + tum.string()), 2);
    EXPECT_NE(complaint.find(tum.string() + ": expected another file than " + what), std::string::npos) << complaint;
  }
  EXPECT_EQ(contents(rawlog), before);
  EXPECT_EQ(lines(truth), 1u);
  EXPECT_FALSE(fs::exists(bag_path()));
}

class ShippedLog : public RawlogToBag {
 protected:
  void SetUp() override {
    if (!fs::exists(datasets)) GTEST_SKIP() << datasets << " is missing (Debian package mrpt-common)";
    RawlogToBag::SetUp();
  }
  void TearDown() override {
    if (!folder.empty()) RawlogToBag::TearDown();
  }
  const fs::path datasets = "/usr/share/mrpt/datasets";
};

TEST_F(ShippedLog, MalagaCampusBuilding) {
  ASSERT_EQ(run(datasets / "2006-01ENE-21-SENA_Telecom Faculty_one_loop_only.rawlog"), 0) << complaint;
  EXPECT_EQ(complaint, "");
  openBag();
  const auto scans = messages<sensor_msgs::LaserScan>(bag, "/scan");
  ASSERT_EQ(scans.size(), 225u);
  EXPECT_EQ(messages<nav_msgs::Odometry>(bag, "/odom").size(), 225u);
  EXPECT_EQ(scans[0].ranges.size(), 361u);
  EXPECT_NEAR(scans[0].angle_increment, M_PI / 360, 1e-6);
  const auto transform = messages<tf2_msgs::TFMessage>(bag, "/tf_static").at(0).transforms.at(0).transform;
  EXPECT_NEAR(transform.translation.x, 0.78, 1e-6);
  EXPECT_NEAR((scans.back().header.stamp - scans.front().header.stamp).toSec(), 59.075, 1e-3);
}

TEST_F(ShippedLog, SimulatedWithGroundTruth) {
  const fs::path rawlog = datasets / "graphslam-engine-demos/action_observations_map/simul.rawlog";
  const fs::path tum = folder / "simul.tum";
  ASSERT_EQ(run(rawlog, "--ground-truth " + rawlog.string() + ".GT.txt --tum " + tum.string()), 0) << complaint;
  openBag();
  EXPECT_EQ(messages<sensor_msgs::LaserScan>(bag, "/scan").size(), 1733u);
  EXPECT_EQ(messages<nav_msgs::Odometry>(bag, "/odom").size(), 1733u);
  EXPECT_EQ(lines(tum), 1733u);
}

}  // namespace
