// What may be a landmark: a corner or a line, and what makes one unlike another.
#pragma once

#include <vector>

#include "sckf_odometry/core/multi_clone_filter.h"
#include "sckf_odometry/matching/corners.h"
#include "sckf_odometry/matching/lines.h"

namespace sckf {

/// What a corner or a line looks like, wherever it is.
struct FeatureShape {
  bool is_line = false;
  double angle = 0.0;  ///< of a corner: between its walls [rad]
  double from = 0.0;   ///< of a line: where it has been seen, along its x axis, from here [m] …
  double to = 0.0;     ///< … to here
};

/// In base_link or in odom.
struct Feature {
  SE2 frame;
  FeatureShape shape;
};

/// As one scan sees it.
struct FeatureSight {
  explicit FeatureSight(const Corner& corner);
  explicit FeatureSight(const Line& line);

  Feature feature() const { return {sighting.base_from_landmark, shape}; }
  int points() const { return (last - first) / every + 1; }
  double farthest() const;  ///< of it from base_link [m]: of a line, its farther end

  Sighting sighting;
  FeatureShape shape;
  int first;  ///< the points that it is made of: from this one …
  int last;   ///< … to this one …
  int every;  ///< … each, or every second, or third, …
};

/// The same seen from elsewhere.
inline Feature moved(const SE2& a_from_b, const Feature& in_b) { return {compose(a_from_b, in_b.frame), in_b.shape}; }

/// How far one is from the other [m]: of lines across them, in the middle of the second.
double distance(const Feature& a, const Feature& b);

/// Whether the same stretch of wall may be meant by two lines: half of the shorter lies beside the other. Lines in line
/// that do not are different walls, or different parts of one.
bool lieSideBySide(const Feature& a, const Feature& b);

/// Whether both can be the same for what they look like; where they are is not asked, but that lines lie side by side.
bool areOfAKind(const Feature& a, const Feature& b);

/// Whether there is room for one of both only: of a kind, and close to each other.
bool areAlike(const Feature& a, const Feature& b);

/// The line grows by what the other one shows of it.
void grow(Feature& line, const Feature& other);

/// Whether it is no farther from the laser than that [m], and a beam reaches it.
bool isCornerInView(const SE2& base_from_corner, const ScannedPoints& points, double farthest);

/// The longest stretch [m] of a line in base_link that is no farther from the laser, and that one beam after the other
/// reaches, those that have another use (for each point) left aside. Its back is not in view.
double stretchInView(const Feature& line, const ScannedPoints& points, const std::vector<bool>& aside, double farthest);

}  // namespace sckf
