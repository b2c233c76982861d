#include <gtest/gtest.h>
#include <sensor_msgs/point_cloud2_iterator.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "core/matrix_matchers.h"
#include "pipeline/simulated_drive.h"
#include "sckf_odometry/ros/conversions.h"
#include "sckf_odometry/ros/debug_markers.h"
#include "text_matchers.h"

namespace sckf {
namespace {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

constexpr double kQuarter = M_PI / 2;

std::shared_ptr<const PreparedScan> scanOf(const std::vector<Eigen::Vector2d>& points) {
  auto scan = std::make_shared<PreparedScan>();
  scan->points.point = points;
  return scan;
}

/// The reference at (1, 2), turned by a quarter, sees one point at (3, 0); the robot is half a metre farther ahead.
PlacedScan referenceScan() { return {scanOf({{9.0, 9.0}, {3.0, 0.0}}), SE2(1.0, 2.0, kQuarter)}; }

ScanReport comparedScan() {
  ScanReport report;
  report.stamp = Stamp(7000000001);
  report.outcome = ScanOutcome::kUpdated;
  report.scan = scanOf({{2.5, 0.1}});
  report.estimate.emplace();
  report.estimate->odom_from_base = SE2(1.0, 2.5, kQuarter);
  report.match.pairs = {{1, 0}};
  report.match.overlap = 0.815;
  report.match.misfit = 1.25;
  return report;
}

/// Seen are those rows of (x, y, yaw); the noise is all in the matching.
Displacement displacementSeeing(const Displacement::MatrixD3& observable, const Eigen::VectorXd& variance) {
  Displacement displacement;
  displacement.reference_from_current = SE2(0.5, 0.0, 0.0);
  displacement.observable = observable;
  displacement.J_reference = Eigen::MatrixXd::Zero(observable.rows(), 0);
  displacement.J_current = displacement.J_reference;
  displacement.matching_noise = variance.asDiagonal();
  return displacement;
}

Displacement::MatrixD3 rows(const std::vector<int>& seen) {
  Displacement::MatrixD3 observable(seen.size(), 3);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    observable.row(static_cast<Eigen::Index>(i)) = Eigen::Vector3d::Unit(seen[i]).transpose();
  }
  return observable;
}

ScanReport withDisplacement(const Displacement& displacement) {
  ScanReport report = comparedScan();
  report.match.displacement = displacement;
  report.prediction.covariance = Eigen::Vector3d(0.09, 0.16, 0.25).asDiagonal();
  return report;
}

Marker find(const MarkerArray& array, const std::string& name_space, int id = 0) {
  const auto is_it = [&](const Marker& marker) { return marker.ns == name_space && marker.id == id; };
  const auto it = std::find_if(array.markers.begin(), array.markers.end(), is_it);
  if (it == array.markers.end()) throw std::out_of_range(name_space);
  return *it;
}

Marker drawn(const ScanReport& report, const std::string& name_space, int id = 0) {
  return find(debugMarkers(report, referenceScan(), "odom"), name_space, id);
}

Eigen::Vector2d at(const Marker& marker, std::size_t i) { return {marker.points.at(i).x, marker.points.at(i).y}; }

TEST(DebugMarkers, EachLaserHasItsOwn) {
  ScanReport second = comparedScan();
  second.laser = 1;
  std::set<std::pair<std::string, int>> names;
  for (const ScanReport& report : {comparedScan(), second}) {
    for (const Marker& marker : debugMarkers(report, referenceScan(), "odom").markers) {
      EXPECT_TRUE(names.emplace(marker.ns, marker.id).second) << marker.ns << " " << marker.id;
    }
    for (const Marker& marker : noDebugMarkers(Stamp(7000000001), "odom", report.laser).markers) {
      EXPECT_EQ(names.count({marker.ns, marker.id}), 1U);
    }
  }
}

TEST(DebugMarkers, APairIsALineFromThePointOfTheReferenceToThatOfTheScanAtTheEstimate) {
  const Marker pairs = drawn(comparedScan(), "pairs");
  EXPECT_EQ(pairs.action, Marker::ADD);
  EXPECT_EQ(pairs.type, Marker::LINE_LIST);
  ASSERT_EQ(pairs.points.size(), 2u);
  EXPECT_TRUE(matricesNear(at(pairs, 0), Eigen::Vector2d(1.0, 5.0), 1e-12));
  EXPECT_TRUE(matricesNear(at(pairs, 1), Eigen::Vector2d(0.9, 5.0), 1e-12));
}

TEST(DebugMarkers, TheEllipseHoldsNinetyFivePercentAboutTheDisplacementInTheFrameOfTheReference) {
  const Eigen::Vector3d variance(0.02 * 0.02, 0.01 * 0.01, 0.1);
  const Marker ellipse = drawn(withDisplacement(displacementSeeing(rows({0, 1, 2}), variance)), "covariance");
  EXPECT_EQ(ellipse.type, Marker::LINE_STRIP);
  Eigen::Vector2d least(1e9, 1e9), most(-1e9, -1e9);
  for (std::size_t i = 0; i < ellipse.points.size(); ++i) {
    least = least.cwiseMin(at(ellipse, i));
    most = most.cwiseMax(at(ellipse, i));
  }
  EXPECT_TRUE(matricesNear(0.5 * (least + most), Eigen::Vector2d(1.0, 2.5), 1e-9));
  // √5.991 = 2.4477 standard deviations, ten times enlarged; x of the reference is y of odom.
  EXPECT_TRUE(matricesNear(0.5 * (most - least), Eigen::Vector2d(0.24477, 0.48955), 1e-4));
  EXPECT_TRUE(matricesNear(at(ellipse, 0), at(ellipse, ellipse.points.size() - 1), 1e-12));
}

TEST(DebugMarkers, TheEllipseTurnsWithTheCorrelation) {
  Displacement displacement = displacementSeeing(rows({0, 1, 2}), Eigen::Vector3d::Ones());
  displacement.matching_noise << 5.0, 4.0, 0.0, 4.0, 5.0, 0.0, 0.0, 0.0, 1.0;  // 9 along (1, 1), 1 along (-1, 1)
  displacement.matching_noise *= 1e-4;
  const Marker ellipse = drawn(withDisplacement(displacement), "covariance");
  const Eigen::Vector2d along(-M_SQRT1_2, M_SQRT1_2);  // (1, 1) turned by a quarter
  double reach_along = 0.0, reach_across = 0.0;
  for (std::size_t i = 0; i < ellipse.points.size(); ++i) {
    const Eigen::Vector2d off = at(ellipse, i) - Eigen::Vector2d(1.0, 2.5);
    reach_along = std::max(reach_along, along.dot(off));
    reach_across = std::max(reach_across, quarterTurn(along).dot(off));
  }
  EXPECT_NEAR(reach_along, 24.477 * 0.03, 1e-3);
  EXPECT_NEAR(reach_across, 24.477 * 0.01, 1e-3);
}

TEST(DebugMarkers, WhatTheScansDoNotSeeIsAsUncertainAsThePrediction) {
  const ScanReport report = withDisplacement(displacementSeeing(rows({1, 2}), Eigen::Vector2d(1e-4, 2e-4)));
  const Eigen::Matrix3d expected = Eigen::Vector3d(0.09, 1e-4, 2e-4).asDiagonal();
  EXPECT_TRUE(matricesNear(displacementCovariance(*report.match.displacement, report.prediction), expected, 1e-12));
}

TEST(DebugMarkers, SeenDirectionsMayBeScaledAndTurned) {
  Displacement::MatrixD3 observable(2, 3);
  observable << 0.6, 0.8, 0.0, 0.0, 0.0, 5.0;  // along (3, 4), and yaw in units of 0.2 rad
  const Displacement displacement = displacementSeeing(observable, Eigen::Vector2d(1e-4, 1.0));
  const Eigen::Vector3d unseen = unobservableDirections(displacement);
  EXPECT_NEAR(std::abs(unseen.dot(Eigen::Vector3d(-0.8, 0.6, 0.0))), 1.0, 1e-12);
  const Eigen::Matrix3d covariance = displacementCovariance(displacement, {SE2(), Eigen::Matrix3d::Identity()});
  const Eigen::Vector3d along(0.6, 0.8, 0.0), across(-0.8, 0.6, 0.0);
  EXPECT_NEAR(along.dot(covariance * along), 1e-4, 1e-12);
  EXPECT_NEAR(across.dot(covariance * across), 1.0, 1e-12);
  EXPECT_NEAR(covariance(2, 2), 1.0 / 25.0, 1e-12);
}

TEST(DebugMarkers, TheArrowPointsForwardsAlongWhatIsNotSeen) {
  ScanReport report = withDisplacement(displacementSeeing(rows({1, 2}), Eigen::Vector2d(1e-4, 1e-4)));
  Marker arrow = drawn(report, "unobservable");
  EXPECT_EQ(arrow.type, Marker::ARROW);
  EXPECT_TRUE(matricesNear(at(arrow, 0), Eigen::Vector2d(1.0, 2.5), 1e-12));
  EXPECT_TRUE(matricesNear(at(arrow, 1), Eigen::Vector2d(1.0, 3.5), 1e-12));
  EXPECT_EQ(drawn(report, "unobservable", 1).action, Marker::DELETE);

  report.estimate->odom_from_base.yaw = -kQuarter;  // the robot has turned round since the reference
  arrow = drawn(report, "unobservable");
  EXPECT_TRUE(matricesNear(at(arrow, 1), Eigen::Vector2d(1.0, 1.5), 1e-12));
}

TEST(DebugMarkers, ATurnThatIsNotSeenIsAnArrowToTheLeftAheadOfTheRobot) {
  const Marker arrow =
      drawn(withDisplacement(displacementSeeing(rows({0, 1}), Eigen::Vector2d(1e-4, 1e-4))), "unobservable");
  EXPECT_TRUE(matricesNear(at(arrow, 0), Eigen::Vector2d(1.0, 3.5), 1e-12));
  EXPECT_TRUE(matricesNear(at(arrow, 1), Eigen::Vector2d(0.0, 3.5), 1e-12));
}

TEST(DebugMarkers, TwoDirectionsAreTwoArrows) {
  const ScanReport report = withDisplacement(displacementSeeing(rows({2}), Eigen::VectorXd::Constant(1, 1e-4)));
  const Marker first = drawn(report, "unobservable", 0);
  const Marker second = drawn(report, "unobservable", 1);
  EXPECT_EQ(first.action, Marker::ADD);
  EXPECT_EQ(second.action, Marker::ADD);
  EXPECT_NEAR((at(first, 1) - at(first, 0)).dot(at(second, 1) - at(second, 0)), 0.0, 1e-12);
}

TEST(DebugMarkers, TheLabelSaysWhatBecameOfTheScanAndHowLargeTheEllipseIs) {
  ScanReport report = withDisplacement(displacementSeeing(rows({0, 1, 2}), Eigen::Vector3d(4e-4, 1e-4, 1e-4)));
  EXPECT_EQ(drawn(report, "label").text,
            "updated\n1 pairs, overlap 82 %, misfit 1.25\n95 %: 4.9 x 2.4 cm (drawn x 10)");
  report.outcome = ScanOutcome::kNoMatch;
  report.match.displacement.reset();
  EXPECT_EQ(drawn(report, "label").text, "no match\n1 pairs, overlap 82 %, misfit 1.25");
}

TEST(DebugMarkers, AllAreInTheFrameOfTheEstimateAtTheScansStamp) {
  const ScanReport report = withDisplacement(displacementSeeing(rows({1}), Eigen::VectorXd::Ones(1)));
  for (const MarkerArray& array :
       {debugMarkers(report, referenceScan(), "my_odom"), noDebugMarkers(Stamp(7000000001), "my_odom")}) {
    for (const Marker& marker : array.markers) {
      EXPECT_EQ(marker.header.frame_id, "my_odom");
      EXPECT_EQ(marker.header.stamp, ros::Time(7, 1));
      EXPECT_EQ(marker.pose.orientation.w, 1.0);  // points are relative to the pose
      EXPECT_EQ(marker.lifetime, ros::Duration(0));
      if (marker.action == Marker::ADD) {
        EXPECT_EQ(marker.color.a, 1.0F) << marker.ns;
      }
    }
  }
}

using Names = std::set<std::pair<std::string, int>>;

Names namesOf(const MarkerArray& array, int action) {
  Names names;
  for (const Marker& marker : array.markers) {
    if (marker.action == action) names.insert({marker.ns, marker.id});
  }
  return names;
}

TEST(DebugMarkers, WhateverIsDrawnOnceIsReplacedOrDeletedByTheNext) {
  const Names all{{"pairs", 0}, {"covariance", 0}, {"unobservable", 0}, {"unobservable", 1}, {"label", 0}};
  EXPECT_EQ(namesOf(noDebugMarkers(Stamp(1), "odom"), Marker::DELETE), all);

  const ScanReport blind = withDisplacement(displacementSeeing(rows({2}), Eigen::VectorXd::Ones(1)));
  EXPECT_EQ(namesOf(debugMarkers(blind, referenceScan(), "odom"), Marker::ADD), all);

  const ScanReport seeing = withDisplacement(displacementSeeing(rows({0, 1, 2}), Eigen::Vector3d::Ones()));
  const Names arrows{{"unobservable", 0}, {"unobservable", 1}};
  EXPECT_EQ(namesOf(debugMarkers(seeing, referenceScan(), "odom"), Marker::DELETE), arrows);

  ScanReport failed = comparedScan();
  failed.match.pairs.clear();
  const Names but_the_label{{"pairs", 0}, {"covariance", 0}, {"unobservable", 0}, {"unobservable", 1}};
  EXPECT_EQ(namesOf(debugMarkers(failed, referenceScan(), "odom"), Marker::DELETE), but_the_label);
}

/// The last scan of a drive with the reference that it was compared with.
std::pair<ScanReport, PlacedScan> lastOf(const test::SimulatedDrive& drive) {
  test::Driven driven(drive);
  driven.run(0, 3000);
  PlacedScan reference;
  for (const ScanReport& report : driven.reports) {
    if (&report != &driven.reports.back() && report.new_reference) {
      reference = {report.scan, report.estimate->odom_from_base};
    }
  }
  return {driven.reports.back(), reference};
}

TEST(DebugMarkers, OfARealMatchThePairsAreShortAndTheEllipseIsAboutTheRobot) {
  const auto [report, reference] = lastOf(test::SimulatedDrive());
  ASSERT_EQ(report.reference_stamp, reference.scan->stamp);
  const MarkerArray array = debugMarkers(report, reference, "odom");
  const Marker pairs = find(array, "pairs");
  ASSERT_GT(pairs.points.size(), 400u);
  for (std::size_t i = 0; i < pairs.points.size(); i += 2) EXPECT_LT((at(pairs, i) - at(pairs, i + 1)).norm(), 0.25);
  const Marker ellipse = find(array, "covariance");
  const Eigen::Vector2d centre = 0.5 * (at(ellipse, 0) + at(ellipse, ellipse.points.size() / 2));
  EXPECT_LT((centre - report.estimate->odom_from_base.translation()).norm(), 0.02);
  EXPECT_EQ(find(array, "unobservable").action, Marker::DELETE);
}

TEST(DebugMarkers, InACorridorTheArrowPointsAlongItAndTheEllipseIsLong) {
  const auto along = [](double t) { return SE2(0.5 * t, 0.1 * std::sin(t), 0.3); };
  const auto [report, reference] = lastOf(test::SimulatedDrive({}, 16000, test::corridor(), along));
  ASSERT_TRUE(report.match.displacement);
  const MarkerArray array = debugMarkers(report, reference, "odom");
  const Marker arrow = find(array, "unobservable");
  const Eigen::Vector2d corridor(std::cos(-0.3), std::sin(-0.3));  // odom is where the robot started, turned by 0.3
  EXPECT_GT(corridor.dot(at(arrow, 1) - at(arrow, 0)), 0.999);
  const Marker ellipse = find(array, "covariance");
  double longest = 0.0;
  for (std::size_t i = 0; i < 24; ++i) {
    longest = std::max(longest, (at(ellipse, i) - at(ellipse, i + 24)).dot(corridor));
    longest = std::max(longest, (at(ellipse, i + 24) - at(ellipse, i)).dot(corridor));
    EXPECT_LT(std::abs((at(ellipse, i) - at(ellipse, i + 24)).dot(quarterTurn(corridor))), 0.3);
  }
  EXPECT_GT(longest, 0.6);
}

TEST(PointCloud, HasThePointsInThePlaneOfTheFrame) {
  const sensor_msgs::PointCloud2 cloud = toPointCloud({{1.5, -2.5}, {3.0, 4.0}}, Stamp(7000000001), "odom");
  EXPECT_EQ(cloud.header.frame_id, "odom");
  EXPECT_EQ(cloud.header.stamp, ros::Time(7, 1));
  ASSERT_EQ(cloud.width * cloud.height, 2u);
  sensor_msgs::PointCloud2ConstIterator<float> point(cloud, "x");
  EXPECT_EQ(point[0], 1.5F);
  EXPECT_EQ(point[1], -2.5F);
  EXPECT_EQ(point[2], 0.0F);
  EXPECT_TRUE(toPointCloud({}, Stamp(1), "odom").data.empty());
}

}  // namespace
}  // namespace sckf
