#include "sckf_odometry/ros/landmark_markers.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "sckf_odometry/ros/conversions.h"
#include "sckf_odometry/ros/debug_markers.h"

namespace sckf {

namespace {

using visualization_msgs::Marker;

constexpr double kAbovePoints = 0.05;   // [m]
constexpr double kLineWidth = 0.04;     // [m]
constexpr double kCrossSize = 0.4;      // [m]
constexpr double kTwoSided = 1.959964;  // std of a Gaussian on either side of 95 %

Marker lines(const std::string& name, float r, float g, float b, Stamp stamp, const std::string& frame) {
  Marker marker;
  marker.header.stamp = toTime(stamp);
  marker.header.frame_id = frame;
  marker.ns = name;
  marker.type = Marker::LINE_LIST;
  marker.pose.orientation.w = 1.0;
  marker.scale.x = kLineWidth;
  marker.color.r = r;
  marker.color.g = g;
  marker.color.b = b;
  marker.color.a = 1.0F;
  marker.action = Marker::DELETE;
  return marker;
}

void addLine(Marker& marker, const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  marker.action = Marker::ADD;
  for (const Eigen::Vector2d& end : {from, to}) {
    geometry_msgs::Point point;
    point.x = end.x();
    point.y = end.y();
    point.z = kAbovePoints;
    marker.points.push_back(point);
  }
}

void addCross(Marker& marker, const SE2& odom_from_landmark) {
  addLine(marker, odom_from_landmark.translation(), odom_from_landmark * Eigen::Vector2d(kCrossSize, 0.0));
  addLine(marker, odom_from_landmark * Eigen::Vector2d(0.0, -0.5 * kCrossSize),
          odom_from_landmark * Eigen::Vector2d(0.0, 0.5 * kCrossSize));
}

void addWall(Marker& marker, const LandmarkView& line) {
  addLine(marker, line.odom_from_landmark * Eigen::Vector2d(line.from, 0.0),
          line.odom_from_landmark * Eigen::Vector2d(line.to, 0.0));
}

void addEllipse(Marker& marker, const LandmarkView& landmark) {
  constexpr int kSides = 32;
  const double radius = std::sqrt(-2.0 * std::log(1.0 - kEllipseConfidence));
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(landmark.covariance.topLeftCorner<2, 2>());
  const Eigen::Vector2d std = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  const auto at = [&](int side) -> Eigen::Vector2d {
    const double angle = 2.0 * M_PI * side / kSides;
    const Eigen::Vector2d off(std.x() * std::cos(angle), std.y() * std::sin(angle));
    return landmark.odom_from_landmark.translation() + radius * eigen.eigenvectors() * off;
  };
  for (int side = 0; side < kSides; ++side) addLine(marker, at(side), at(side + 1));
}

/// Where the line runs, but for 5 %: offset and lever of the yaw, at places along it.
void addBand(Marker& marker, const LandmarkView& line) {
  constexpr int kPieces = 16;
  const Eigen::Vector2d across = line.odom_from_landmark.rotation() * Eigen::Vector2d::UnitY();
  const auto edge = [&](int piece, double side) -> Eigen::Vector2d {
    const double along = line.from + (line.to - line.from) * piece / kPieces;
    const Eigen::Vector3d by_error(across.x(), across.y(), along);
    const double std = std::sqrt(std::max(0.0, by_error.dot(line.covariance * by_error)));
    return line.odom_from_landmark * Eigen::Vector2d(along, side * kTwoSided * std);
  };
  for (const double side : {-1.0, 1.0}) {
    for (int piece = 0; piece < kPieces; ++piece) addLine(marker, edge(piece, side), edge(piece + 1, side));
  }
}

}  // namespace

visualization_msgs::MarkerArray landmarkMarkers(const std::vector<LandmarkView>& landmarks, Stamp stamp,
                                                const std::string& frame) {
  Marker others = lines("landmarks", 0.35F, 0.60F, 0.90F, stamp, frame);
  Marker seen = lines("seen", 1.0F, 0.82F, 0.16F, stamp, frame);
  Marker covariance = lines("covariance", 0.78F, 0.47F, 1.0F, stamp, frame);
  Marker other_walls = lines("lines", 0.35F, 0.60F, 0.90F, stamp, frame);
  Marker seen_walls = lines("seen_lines", 1.0F, 0.82F, 0.16F, stamp, frame);
  Marker bands = lines("covariance_of_lines", 0.78F, 0.47F, 1.0F, stamp, frame);
  for (const LandmarkView& landmark : landmarks) {
    if (landmark.is_line) {
      addWall(landmark.used ? seen_walls : other_walls, landmark);
      addBand(bands, landmark);
    } else {
      addCross(landmark.used ? seen : others, landmark.odom_from_landmark);
      addEllipse(covariance, landmark);
    }
  }
  visualization_msgs::MarkerArray array;
  array.markers = {others, seen, covariance, other_walls, seen_walls, bands};
  return array;
}

}  // namespace sckf
