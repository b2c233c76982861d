// Hours of a robot's life through the nodelet, as fast as it goes: nothing is lost, nothing grows.
//
// Parameters: ~hours of robot time, ~nodelet (false: the node's class, called back by ~threads), ~beams of a scan,
// ~csv: a file for the curve of memory, ~max_growth [MB] from a quarter of the time on; 0: not looked at.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <fstream>
#include <iostream>
#include <limits>
#include <vector>

#include "soak/endless_drive.h"
#include "soak/host.h"
#include "soak/watch.h"

namespace {

std::atomic<int> thread_sanitizer_reports{0};

}  // namespace

/// Called by the thread sanitizer for each report that is not suppressed.
extern "C" void __tsan_on_report(void* /*report*/) { ++thread_sanitizer_reports; }

namespace sckf::test {
namespace {

/// Memory of this process that is in RAM [MB].
double residentMemory() {
  std::ifstream statm("/proc/self/statm");
  double total = 0.0, resident = 0.0;
  statm >> total >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

struct Settings {
  double hours = 0.25;
  bool nodelet = true;
  int threads = 4;
  int beams = 361;
  double max_growth = 0.0;
  std::string csv;

  Settings() {
    const ros::NodeHandle nh("~");
    nh.getParam("hours", hours);
    nh.getParam("nodelet", nodelet);
    nh.getParam("threads", threads);
    nh.getParam("beams", beams);
    nh.getParam("max_growth", max_growth);
    nh.getParam("csv", csv);
  }
};

/// What was sent, by what has to become of it.
struct Sent {
  std::size_t good = 0;       ///< scans of where the robot is
  std::size_t displaced = 0;  ///< scans of where it is not
  std::size_t blind = 0;      ///< scans without a range
  std::size_t repeated = 0;   ///< scans sent a second time
  std::size_t unstamped = 0;
  std::size_t scans() const { return good + displaced + blind + repeated + unstamped; }
};

struct MemoryAt {
  double robot_time;  // [s]
  double wall_time;   // [s]
  double resident;    // [MB]
  std::size_t scans;
};

class Soak : public ::testing::Test {
 public:
  static void SetUpTestSuite() {
    settings = std::make_unique<Settings>();
    watch = std::make_unique<Watch>();
    Host host(settings->nodelet, static_cast<uint32_t>(settings->threads));
    drive();
    all_accounted_for = watch->waitForScans(sent.scans());
  }

  static void TearDownTestSuite() {
    const MemoryAt& end = memory.back();
    std::cout << "soak: " << end.robot_time / 3600.0 << " h of robot time in " << end.wall_time << " s; "
              << sent.scans() << " scans: " << watch->allScans() << "memory " << memory[memory.size() / 4].resident
              << " MB after a quarter, " << end.resident << " MB at the end; off by " << final_error << " m"
              << std::endl;
    watch.reset();
    settings.reset();
  }

 protected:
  static void drive() {
    ros::NodeHandle nh;
    const ros::Publisher mounts = nh.advertise<tf2_msgs::TFMessage>("/tf_static", 1, true);
    const ros::Publisher odometry = nh.advertise<nav_msgs::Odometry>("odom", 1000);
    const ros::Publisher scans = nh.advertise<sensor_msgs::LaserScan>("scan", 1000);
    EndlessDrive robot(settings->beams);
    mounts.publish(robot.mount());
    const auto number = [](double period) { return static_cast<std::size_t>(settings->hours * 3600.0 / period); };
    const std::size_t last = number(EndlessDrive::kOdometryPeriod);
    const std::size_t every = std::max<std::size_t>(1, last / 200);
    const ros::SteadyTime begin = ros::SteadyTime::now();
    std::size_t scan = 0;
    for (std::size_t k = 0; k <= last; ++k) {
      for (; EndlessDrive::scanStamp(scan) < EndlessDrive::odometryStamp(k); ++scan) sendScan(scans, robot, scan);
      odometry.publish(robot.nextOdometry());
      if (k >= kAhead) {
        const std::size_t poses = scan > kScansAhead ? scan - kScansAhead : 0;
        keeping_up = keeping_up && watch->waitFor(EndlessDrive::odometryStamp(k - kAhead), poses);
      }
      if (!keeping_up) break;
      if (k % every == 0 || k == last) remember(k, scan, (ros::SteadyTime::now() - begin).toSec());
    }
    watch->waitFor(EndlessDrive::odometryStamp(last), 0);
    const SE2 truth = EndlessDrive::truth(EndlessDrive::odometryStamp(last));
    final_error = between(truth, watch->pose()).translation().norm();
  }

  /// Of a thousand scans some are not as they should be.
  static void sendScan(const ros::Publisher& scans, EndlessDrive& robot, std::size_t k) {
    const bool displaced = k % 1000 == 300;
    const bool blind = k % 1000 == 500;
    const sensor_msgs::LaserScanPtr message = robot.scan(k, displaced ? SE2(0.4, -0.3, 0.3) : SE2());
    if (blind) message->ranges.assign(message->ranges.size(), std::numeric_limits<float>::infinity());
    scans.publish(message);
    ++(displaced ? sent.displaced : blind ? sent.blind : sent.good);
    if (k % 1000 == 700) {
      scans.publish(message);
      ++sent.repeated;
    }
    if (k % 1000 == 900) {
      const auto unstamped = boost::make_shared<sensor_msgs::LaserScan>(*message);
      unstamped->header.stamp = ros::Time();
      scans.publish(unstamped);
      ++sent.unstamped;
    }
  }

  static void remember(std::size_t odometry, std::size_t scans, double wall_time) {
    memory.push_back(
        {static_cast<double>(odometry) * EndlessDrive::kOdometryPeriod, wall_time, residentMemory(), scans});
    if (settings->csv.empty()) return;
    std::ofstream csv(settings->csv, memory.size() == 1 ? std::ios::trunc : std::ios::app);
    if (memory.size() == 1) csv << "robot_time_s,wall_time_s,resident_mb,scans\n";
    const MemoryAt& now = memory.back();
    csv << now.robot_time << "," << now.wall_time << "," << now.resident << "," << now.scans << "\n";
  }

  // So many messages may be under way: no queue overflows, and odometry does not outrun the scans by far.
  static constexpr std::size_t kAhead = 20;  // of odometry
  static constexpr std::size_t kScansAhead = 10;
  static inline std::unique_ptr<Settings> settings;
  static inline std::unique_ptr<Watch> watch;
  static inline Sent sent;
  static inline std::vector<MemoryAt> memory;
  static inline bool keeping_up = true;
  static inline bool all_accounted_for = false;
  static inline double final_error = 0.0;  // [m]
};

TEST_F(Soak, ThereIsAlwaysAnEstimate) { EXPECT_TRUE(keeping_up); }

TEST_F(Soak, EveryEstimateCanBeBelieved) { EXPECT_EQ(watch->bad(), 0u); }

TEST_F(Soak, EveryScanIsAccountedFor) {
  EXPECT_TRUE(all_accounted_for);
  EXPECT_EQ(watch->scans("together"), sent.scans()) << watch->allScans();
}

TEST_F(Soak, BadScansAreCountedByWhatIsWrongWithThem) {
  EXPECT_EQ(watch->scans("unusable"), sent.blind);
  EXPECT_EQ(watch->scans("out of order"), sent.repeated);
  EXPECT_EQ(watch->scans("refused"), sent.unstamped);
}

TEST_F(Soak, GoodScansAreUsed) {
  const std::size_t used = watch->scans("reference") + watch->scans("updated") + watch->scans("slip");
  EXPECT_GE(static_cast<double>(used), 0.99 * static_cast<double>(sent.good)) << watch->allScans();
}

TEST_F(Soak, EachScanWithAStampOfItsOwnHasAPose) { EXPECT_EQ(watch->poses(), sent.good + sent.displaced + sent.blind); }

#ifdef __SANITIZE_THREAD__
TEST_F(Soak, ThreadsDoNotRace) { EXPECT_EQ(thread_sanitizer_reports, 0) << "see the reports above"; }
#endif

TEST_F(Soak, MemoryIsFlat) {
  if (settings->max_growth <= 0.0) GTEST_SKIP() << "not looked at";
  const auto later = [](const MemoryAt& a, const MemoryAt& b) { return a.resident < b.resident; };
  const auto quarter = memory.begin() + static_cast<std::ptrdiff_t>(memory.size() / 4);
  const auto half = memory.begin() + static_cast<std::ptrdiff_t>(memory.size() / 2);
  const double before = std::max_element(quarter, half, later)->resident;
  const double after = std::max_element(half, memory.end(), later)->resident;
  EXPECT_LE(after - before, settings->max_growth) << before << " MB, then " << after << " MB";
}

}  // namespace
}  // namespace sckf::test

int main(int argc, char** argv) {
  ::testing::InitGoogleMock(&argc, argv);
  ros::init(argc, argv, "test_soak");
  return RUN_ALL_TESTS();
}
