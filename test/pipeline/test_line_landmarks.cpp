// Walls as landmarks: which piece of wall is which landmark, which may be two, what a corner leaves of them, and when
// one is given up.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "pipeline/simulated_drive.h"

namespace sckf::test {
namespace {

Wall wallAt(double y, double from, double to) { return {{from, y}, {to, y}}; }

/// Landmarks and the filter that has them, driven by scans of a world that changes.
class Watcher {
 public:
  explicit Watcher(const std::string& use = "lines", double min_length = 1.5) : landmarks_(options(use, min_length)) {}

  /// Returns how many landmarks have been seen again.
  int see(const World& world, const SE2& truth = SE2()) {
    SimulatedLaser laser;
    laser.beams = 1441;
    laser.angle_increment = 2.0 * M_PI / 1441.0;
    const auto scan = prepareScan(simulateScan(world, truth, laser), Eigen::Isometry3d::Identity(), ScanOptions());
    rest_ = landmarks_.claim(scan, filter_, SurfaceOptions());
    return landmarks_.update(filter_);
  }
  int see(const World& world, int times) {
    int used = 0;
    for (int i = 0; i < times; ++i) used = see(world);
    return used;
  }

  void shareWithMatch(double max_share) {
    LandmarkOptions shared = options("lines", 1.5);
    shared.only = false;
    shared.max_share = max_share;
    landmarks_.setOptions(shared);
  }

  void drive(const SE2& motion, const Eigen::Vector3d& std) {
    filter_.propagate({motion, std.cwiseAbs2().asDiagonal()});
  }

  SE2 pose() const { return filter_.pose(); }
  std::vector<LandmarkView> views() const { return landmarks_.views(filter_); }
  std::size_t setAside() const { return rest_->set_aside.size(); }

 private:
  static LandmarkOptions options(const std::string& use, double min_length) {
    LandmarkOptions options;
    options.use = use;
    options.only = true;
    options.max_std = 1.0;
    options.line.min_length = min_length;
    options.line.std_offset = options.line.std_yaw = 0.01;
    return options;
  }

  Landmarks landmarks_;
  MultiCloneFilter filter_{SE2(), 1e-8 * Eigen::Matrix3d::Identity()};
  std::shared_ptr<const PreparedScan> rest_;
};

TEST(LineLandmarks, TheyAreTheWallsOfTheRoom) {
  const SimulatedDrive drive;
  PipelineOptions options;
  options.landmarks.use = "lines";
  Driven driven(drive, options);
  driven.odometry(0);
  driven.run(0, 16000);
  const auto& landmarks = driven.reports.back().landmarks;
  EXPECT_GE(landmarks.size(), 3U);
  for (const LandmarkView& landmark : landmarks) {
    ASSERT_TRUE(landmark.is_line);
    EXPECT_GT(landmark.to - landmark.from, 4.0);
    const SE2 line_from_world = inverse(compose(roundDrive(0.0), landmark.odom_from_landmark));
    double nearest = 1e9;
    for (const Wall& wall : room()) {
      const Eigen::Vector2d a = line_from_world * wall.from;
      const Eigen::Vector2d b = line_from_world * wall.to;
      const bool covers = std::min(a.x(), b.x()) < landmark.from + 0.2 && std::max(a.x(), b.x()) > landmark.to - 0.2;
      if (covers) nearest = std::min(nearest, std::max(std::abs(a.y()), std::abs(b.y())));
    }
    EXPECT_LT(nearest, 0.1) << line_from_world.vector().transpose();
  }
}

TEST(LineLandmarks, AWallTellsWhatIsAcrossItAndTheYaw) {
  Watcher watcher;
  watcher.see({wallAt(3.0, -4.0, 4.0)}, 4);
  ASSERT_EQ(watcher.views().size(), 1U);
  watcher.drive(SE2(0.5, 0.0, 0.0), {0.2, 0.2, 0.1});
  const SE2 truth(0.6, 0.15, 0.08);
  EXPECT_EQ(watcher.see({wallAt(3.0, -4.0, 4.0)}, truth), 1);
  EXPECT_NEAR(watcher.pose().y, truth.y, 0.03);
  EXPECT_NEAR(watcher.pose().yaw, truth.yaw, 0.03);
  EXPECT_NEAR(watcher.pose().x, 0.5, 0.02) << "along it, the wheels";
}

TEST(LineLandmarks, WhatIsTooUnlikelyIsNotTheSame) {
  Watcher watcher;
  watcher.see({wallAt(3.0, -4.0, 4.0)}, 4);
  watcher.drive(SE2(), {0.02, 0.02, 0.01});
  EXPECT_EQ(watcher.see({wallAt(3.0, -4.0, 4.0)}, SE2(0.0, 0.2, 0.0)), 0);
}

TEST(LineLandmarks, OneThatMayBeTwoLandmarksIsNeither) {
  // A wall, and another one half a metre behind it when that is gone: side by side.
  for (const double std : {0.05, 0.5}) {
    Watcher watcher;
    watcher.see({wallAt(3.0, -4.0, 4.0)}, 4);
    watcher.see({wallAt(3.5, -4.0, 4.0)}, 4);
    ASSERT_EQ(watcher.views().size(), 2U);
    watcher.drive(SE2(), {0.01, std, 0.01});
    EXPECT_EQ(watcher.see({wallAt(3.5, -4.0, 4.0)}), std < 0.1 ? 1 : 0);
  }
}

TEST(LineLandmarks, TheMatchKeepsTheWall) {
  // A scan that looks at one wall with half of its points, and at the next one without: what landmarks take of it must
  // not leave the two with nothing in common.
  const auto worst = [](const std::string& use) {
    const SimulatedDrive drive;
    PipelineOptions options;
    options.landmarks.use = use;
    options.landmarks.max_share = 1.0;
    Driven driven(drive, options);
    driven.odometry(0);
    driven.run(0, 16000);
    double overlap = 1.0;
    std::size_t used = 0;
    for (const ScanReport& report : driven.reports) {
      if (report.match.displacement) overlap = std::min(overlap, report.match.overlap);
      used += static_cast<std::size_t>(report.landmarks_used);
    }
    EXPECT_EQ(used > 100U, use == "lines");
    return overlap;
  };
  EXPECT_GT(worst("lines"), worst("none") - 0.1);
}

TEST(LineLandmarks, WallsInLineAreTwoAndEachIsItself) {
  // On either side of a gap, on one line: however well they are aligned, what is seen is the one that lies there.
  const Wall left = wallAt(3.0, -6.0, -2.0);
  const Wall right = wallAt(3.0, 2.0, 6.0);
  Watcher watcher;
  watcher.see({left, right}, 4);
  ASSERT_EQ(watcher.views().size(), 2U);
  EXPECT_EQ(watcher.see({left, right}), 2);
  EXPECT_EQ(watcher.see({right}), 1);
  for (const LandmarkView& view : watcher.views()) {
    const double x = (view.odom_from_landmark * Eigen::Vector2d(0.5 * (view.from + view.to), 0.0)).x();
    EXPECT_EQ(view.used, x > 0.0);
  }
}

TEST(LineLandmarks, BothPiecesOfAWallWithSomethingBeforeItAreIt) {
  const Wall wall = wallAt(3.0, -4.0, 4.0);
  Watcher watcher;
  watcher.see({wall}, 4);
  const double before = watcher.views().at(0).covariance(2, 2);
  EXPECT_EQ(watcher.see({wall, wallAt(2.0, -0.4, 0.4)}), 1);
  ASSERT_EQ(watcher.views().size(), 1U);
  EXPECT_GE(watcher.setAside(), 2U * 6U) << "of both pieces";
  EXPECT_LT(watcher.views()[0].covariance(2, 2), before);
  for (int i = 0; i < 20; ++i) watcher.see({wall, wallAt(2.0, -0.4, 0.4)});
  EXPECT_EQ(watcher.views().size(), 1U) << "none of them is a wall of its own";
}

TEST(LineLandmarks, AWallGrowsAsMoreOfItIsSeen) {
  Watcher watcher;
  watcher.see({wallAt(3.0, -4.0, 1.0)}, 4);
  watcher.see({wallAt(3.0, -4.0, 4.0)}, 1);
  watcher.see({wallAt(3.0, -1.0, 4.0)}, 1);
  ASSERT_EQ(watcher.views().size(), 1U);
  EXPECT_NEAR(watcher.views()[0].to - watcher.views()[0].from, 8.0, 0.2);
}

TEST(LineLandmarks, WhatCornersTakeIsInNoLine) {
  const World small = closedPolygon({{-1.4, -1.4}, {1.4, -1.4}, {1.4, 1.4}, {-1.4, 1.4}});
  const auto lines = [&](const std::string& use) {
    Watcher watcher(use);
    watcher.see(small, 6);
    std::size_t n = 0;
    for (const LandmarkView& view : watcher.views()) n += view.is_line ? 1 : 0;
    return n;
  };
  EXPECT_GE(lines("lines"), 3U);
  EXPECT_EQ(lines("corners_and_lines"), 0U) << "corners have all of these walls";
  EXPECT_EQ(lines("corners"), 0U);
}

TEST(LineLandmarks, WhatIsTakenAwayIsGivenUpAndWhatIsHiddenIsNot) {
  const World room = closedPolygon({{-8, -6}, {8, -6}, {8, 6}, {-8, 6}});
  World with_screen = room;
  with_screen.push_back(wallAt(3.0, -3.0, 3.0));
  World hidden = with_screen;
  hidden.push_back(wallAt(1.0, -2.0, 2.0));
  const auto screens = [](const Watcher& watcher) {
    std::size_t n = 0;
    for (const LandmarkView& view : watcher.views()) n += std::abs(view.odom_from_landmark.y - 3.0) < 0.1 ? 1 : 0;
    return n;
  };
  Watcher watcher;
  watcher.see(with_screen, 4);
  ASSERT_EQ(screens(watcher), 1U);
  watcher.see(hidden, 15);
  EXPECT_EQ(screens(watcher), 1U) << "hidden";
  watcher.see(room, 9);
  EXPECT_EQ(screens(watcher), 1U) << "not yet";
  watcher.see(room, 1);
  EXPECT_EQ(screens(watcher), 0U) << "gone";
}

TEST(LineLandmarks, WhatGivesWayToTheMatchIsNotMissed) {
  Watcher watcher;
  watcher.see({wallAt(3.0, -4.0, 4.0)}, 4);
  watcher.shareWithMatch(0.0);
  EXPECT_EQ(watcher.see({wallAt(3.0, -4.0, 4.0)}, 15), 0);
  EXPECT_EQ(watcher.setAside(), 0U);
  EXPECT_EQ(watcher.views().size(), 1U);
}

}  // namespace
}  // namespace sckf::test
