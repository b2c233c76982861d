#include "sckf_odometry/ros/debug_markers.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>
#include <cstdio>

#include "sckf_odometry/ros/conversions.h"

namespace sckf {

namespace {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

constexpr double kAbovePoints = 0.05;   // [m] so that the points of the scans do not hide what is drawn about them
constexpr double kPairWidth = 0.025;    // [m]
constexpr double kEllipseWidth = 0.04;  // [m]
constexpr double kTextHeight = 0.25;    // [m]

struct Colour {
  float r, g, b;
};
constexpr Colour kPairColour{0.24F, 0.90F, 0.24F};
constexpr Colour kCovarianceColour{0.78F, 0.47F, 1.0F};
constexpr Colour kUnobservableColour{1.0F, 0.27F, 0.24F};
constexpr Colour kLabelColour{1.0F, 0.90F, 0.63F};

/// All markers there are. A displacement sees one direction at least, so two at most are not seen.
enum Index : std::size_t { kPairs, kCovariance, kUnobservable, kSecondUnobservable, kLabel, kMarkers };

constexpr int kIds = 2;  // of a laser in a name space

struct Name {
  const char* name_space;
  int id;
};
constexpr std::array<Name, kMarkers> kNames{
    {{"pairs", 0}, {"covariance", 0}, {"unobservable", 0}, {"unobservable", 1}, {"label", 0}}};

geometry_msgs::Point toPoint(const Eigen::Vector2d& p) {
  geometry_msgs::Point point;
  point.x = p.x();
  point.y = p.y();
  point.z = kAbovePoints;
  return point;
}

void draw(Marker& marker, int type, const Colour& colour) {
  marker.action = Marker::ADD;
  marker.type = type;
  marker.color.r = colour.r;
  marker.color.g = colour.g;
  marker.color.b = colour.b;
  marker.color.a = 1.0F;
}

void drawPairs(Marker& marker, const PlacedScan& reference, const PlacedScan& aligned, const std::vector<Pair>& pairs) {
  draw(marker, Marker::LINE_LIST, kPairColour);
  marker.scale.x = kPairWidth;
  for (const Pair& pair : pairs) {
    const Eigen::Vector2d& from = reference.scan->points.point[static_cast<std::size_t>(pair.reference)];
    const Eigen::Vector2d& to = aligned.scan->points.point[static_cast<std::size_t>(pair.current)];
    marker.points.push_back(toPoint(reference.odom_from_base * from));
    marker.points.push_back(toPoint(aligned.odom_from_base * to));
  }
}

/// Standard deviations that hold kEllipseConfidence of two normal variables: the root of χ² of two degrees of freedom.
double ellipseRadius() { return std::sqrt(-2.0 * std::log(1.0 - kEllipseConfidence)); }

/// Half axes of the ellipse [m] in the columns, the short one first.
Eigen::Matrix2d halfAxes(const Eigen::Matrix2d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(covariance);
  const Eigen::Vector2d std = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  return ellipseRadius() * eigen.eigenvectors() * std.asDiagonal();
}

void drawEllipse(Marker& marker, const SE2& odom_from_reference, const SE2& reference_from_current,
                 const Eigen::Matrix2d& half_axes) {
  constexpr int kCorners = 48;
  draw(marker, Marker::LINE_STRIP, kCovarianceColour);
  marker.scale.x = kEllipseWidth;
  for (int i = 0; i <= kCorners; ++i) {
    const double angle = 2.0 * M_PI * i / kCorners;
    const Eigen::Vector2d off = kEllipseMagnification * half_axes * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    marker.points.push_back(toPoint(odom_from_reference * (reference_from_current.translation() + off)));
  }
}

/// The arrow where the robot would move by (x, y, yaw), which is in the reference base_link and has no sign.
void drawArrow(Marker& marker, const SE2& odom_from_base, const SE2& odom_from_reference,
               const Eigen::Vector3d& motion) {
  draw(marker, Marker::ARROW, kUnobservableColour);
  marker.scale.x = 0.06;  // shaft, head and length of the head [m]
  marker.scale.y = 0.18;
  marker.scale.z = 0.25;
  const Eigen::Vector2d ahead = odom_from_base.rotation().col(0);
  const bool turns = std::abs(motion.z()) > motion.head<2>().norm();
  Eigen::Vector2d from = odom_from_base.translation();
  Eigen::Vector2d direction = odom_from_reference.rotation() * motion.head<2>();
  if (turns) {
    from += kArrowLength * ahead;
    direction += motion.z() * kArrowLength * quarterTurn(ahead);
  }
  const bool backwards = direction.dot(turns ? quarterTurn(ahead) : ahead) < 0.0;
  const Eigen::Vector2d arrow = (backwards ? -kArrowLength : kArrowLength) * direction.normalized();
  marker.points = {toPoint(from), toPoint(from + arrow)};
}

std::string numbers(const ScanReport& report) {
  std::array<char, 200> text{};
  std::snprintf(text.data(), text.size(), "%s\n%zu pairs, overlap %.0f %%, misfit %.2f",
                toString(report.outcome).c_str(), report.match.pairs.size(), 100.0 * report.match.overlap,
                report.match.misfit);
  return text.data();
}

std::string numbers(const Eigen::Matrix2d& half_axes) {
  std::array<char, 200> text{};
  std::snprintf(text.data(), text.size(), "\n%.0f %%: %.1f x %.1f cm (drawn x %.0f)", 100.0 * kEllipseConfidence,
                100.0 * half_axes.col(1).norm(), 100.0 * half_axes.col(0).norm(), kEllipseMagnification);
  return text.data();
}

void drawLabel(Marker& marker, const SE2& odom_from_base, std::size_t laser, const std::string& text) {
  draw(marker, Marker::TEXT_VIEW_FACING, kLabelColour);
  marker.scale.z = kTextHeight;
  const double below = 5.0 * kTextHeight * static_cast<double>(1 + laser);
  marker.pose.position = toPoint(odom_from_base.translation() - Eigen::Vector2d(0.0, below));
  marker.text = text;
}

}  // namespace

Eigen::Matrix3Xd unobservableDirections(const Displacement& displacement) {
  const Eigen::Matrix3d seen = displacement.observable.transpose() * displacement.observable;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(seen);  // eigenvalues increase: those of 0 are the first
  return eigen.eigenvectors().leftCols(3 - displacement.dimension());
}

Eigen::Matrix3d displacementCovariance(const Displacement& displacement, const DisplacementPrediction& prediction) {
  const auto& C = displacement.observable;
  const Displacement::MatrixDD gram = C * C.transpose();
  const Eigen::Matrix3Xd from_seen = C.transpose() * gram.inverse();
  const Eigen::Matrix3Xd unseen = unobservableDirections(displacement);
  const Eigen::Matrix3d onto_unseen = unseen * unseen.transpose();
  return from_seen * displacement.covariance() * from_seen.transpose() +
         onto_unseen * prediction.covariance * onto_unseen;
}

MarkerArray debugMarkers(const ScanReport& report, const PlacedScan& reference, const std::string& frame) {
  MarkerArray array = noDebugMarkers(report.stamp, frame, report.laser);
  const PlacedScan aligned{report.scan, report.estimate->odom_from_base};
  if (!report.match.pairs.empty()) drawPairs(array.markers[kPairs], reference, aligned, report.match.pairs);
  std::string label = numbers(report);
  if (const auto& displacement = report.match.displacement) {
    const Eigen::Matrix3d covariance = displacementCovariance(*displacement, report.prediction);
    const Eigen::Matrix2d half_axes = halfAxes(covariance.topLeftCorner<2, 2>());
    drawEllipse(array.markers[kCovariance], reference.odom_from_base, displacement->reference_from_current, half_axes);
    label += numbers(half_axes);
    const Eigen::Matrix3Xd unseen = unobservableDirections(*displacement);
    for (Eigen::Index i = 0; i < unseen.cols(); ++i) {
      drawArrow(array.markers[kUnobservable + static_cast<std::size_t>(i)], aligned.odom_from_base,
                reference.odom_from_base, unseen.col(i));
    }
  }
  drawLabel(array.markers[kLabel], aligned.odom_from_base, report.laser, label);
  return array;
}

MarkerArray noDebugMarkers(Stamp stamp, const std::string& frame, std::size_t laser) {
  MarkerArray array;
  for (const Name& name : kNames) {
    Marker marker;
    marker.header.stamp = toTime(stamp);
    marker.header.frame_id = frame;
    marker.ns = name.name_space;
    marker.id = name.id + kIds * static_cast<int>(laser);
    marker.action = Marker::DELETE;
    marker.pose.orientation.w = 1.0;
    array.markers.push_back(marker);
  }
  return array;
}

}  // namespace sckf
