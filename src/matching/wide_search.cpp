#include "sckf_odometry/matching/wide_search.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace sckf {

namespace {

constexpr double kCell = 0.1;         // [m]
constexpr double kYawStep = 0.04;     // [rad]: half a metre off at 12 m are two steps
constexpr double kFarthest = 20.0;    // [m] points beyond tell too little at such steps
constexpr std::size_t kPoints = 120;  // of the current scan, evenly taken

struct Cell {
  int column;
  int row;
};

Cell cellOf(const Eigen::Vector2d& point) {
  return {static_cast<int>(std::lround(point.x() / kCell)), static_cast<int>(std::lround(point.y() / kCell))};
}

/// How near each cell is to a point of a scan: 0 to kOnIt.
class NearnessGrid {
 public:
  static constexpr std::uint8_t kOnIt = 4;

  explicit NearnessGrid(const std::vector<Eigen::Vector2d>& points) {
    for (const Eigen::Vector2d& point : points) {
      if (point.norm() > kFarthest) continue;
      const Cell cell = cellOf(point);
      for (int row = -2; row <= 2; ++row) {
        for (int column = -2; column <= 2; ++column) {
          const int away = std::max(std::abs(row), std::abs(column));
          auto& nearness = nearness_[index(cell.column + column, cell.row + row)];
          nearness = std::max(nearness, static_cast<std::uint8_t>(kOnIt - 1.5 * away));
        }
      }
    }
  }

  int at(int column, int row) const {
    const bool inside = std::abs(column) <= kHalf && std::abs(row) <= kHalf;
    return inside ? nearness_[index(column, row)] : 0;
  }

 private:
  static constexpr int kHalf = static_cast<int>(kFarthest / kCell) + 3;
  static constexpr int kWidth = 2 * kHalf + 1;
  static std::size_t index(int column, int row) {
    return static_cast<std::size_t>((row + kHalf) * kWidth + column + kHalf);
  }

  std::vector<std::uint8_t> nearness_ = std::vector<std::uint8_t>(kWidth * kWidth, 0);
};

std::vector<Eigen::Vector2d> evenlyTaken(const std::vector<Eigen::Vector2d>& points) {
  const std::size_t every = (points.size() + kPoints - 1) / kPoints;
  std::vector<Eigen::Vector2d> taken;
  for (std::size_t i = 0; i < points.size(); i += every) taken.push_back(points[i]);
  return taken;
}

}  // namespace

SE2 widelySearched(const PreparedScan& reference, const PreparedScan& current, const SE2& predicted,
                   const WideSearchOptions& options) {
  // Of all points, so many must tell against the prediction for one of its bounds to be reached.
  constexpr double kPriceOfBound = 0.2;
  const NearnessGrid grid(reference.points.point);
  const std::vector<Eigen::Vector2d> points = evenlyTaken(current.points.point);
  const int turns = static_cast<int>(options.yaw / kYawStep);
  const int steps = static_cast<int>(options.translation / kCell);
  const double price = kPriceOfBound * NearnessGrid::kOnIt * static_cast<double>(points.size());
  double best = -1e9;
  SE2 found = predicted;
  std::vector<Cell> cells(points.size());
  for (int turn = -turns; turn <= turns; ++turn) {
    const SE2 turned(predicted.x, predicted.y, predicted.yaw + turn * kYawStep);
    const Eigen::Matrix2d C = turned.rotation();
    for (std::size_t i = 0; i < points.size(); ++i) cells[i] = cellOf(C * points[i] + turned.translation());
    for (int y = -steps; y <= steps; ++y) {
      for (int x = -steps; x <= steps; ++x) {
        int sum = 0;
        for (const Cell& cell : cells) sum += grid.at(cell.column + x, cell.row + y);
        const double away = std::pow(static_cast<double>(turn) / std::max(turns, 1), 2) +
                            static_cast<double>(x * x + y * y) / std::max(steps * steps, 1);
        const double score = sum - price * away;
        if (score <= best) continue;
        best = score;
        found = SE2(turned.x + x * kCell, turned.y + y * kCell, turned.yaw);
      }
    }
  }
  return found;
}

}  // namespace sckf
