// Where one scan may lie on another when the wheels have told of nothing like it: correlative matching (Olson, ICRA
// 2009) of points.
#pragma once

#include <vector>

#include "sckf_odometry/core/se2.h"
#include "sckf_odometry/matching/prepared_scan.h"

namespace sckf {

struct WideSearchOptions {
  double yaw = 1.6;          ///< [rad] to either side of the prediction; 0: no such search
  double translation = 1.5;  ///< [m] ahead, behind and to either side of it
};

/// The price of widelySearched() at which, where scans hardly tell, the wheels do.
constexpr double kPriceOfDistance = 0.14;

/// Of all displacements in steps of 10 cm and 2.3° about the predicted one (in a hall with most walls beyond 20 m of
/// larger and finer ones), those at which most points of the current
/// scan lie near points of the reference: up to three that are turned against each other, as a room with square corners
/// looks alike, the best first. Good to about such a step, as the start of an alignment. price: of all points, so many
/// must tell against the prediction for a place that is 1 m, or 1 rad, from it, so that where the scans hardly tell
/// places are near the prediction; 0: all places are alike.
std::vector<SE2> widelySearched(const PreparedScan& reference, const PreparedScan& current, const SE2& predicted,
                                const WideSearchOptions& options, double price);

}  // namespace sckf
