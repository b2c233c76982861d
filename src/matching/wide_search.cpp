#include "sckf_odometry/matching/wide_search.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "sckf_odometry/core/se2.h"

namespace sckf {

namespace {

constexpr int kBlock = 4;             // cells to a side, that are looked at together first
constexpr std::size_t kPoints = 120;  // of the current scan, evenly taken
constexpr std::size_t kPlaces = 3;    // at most
constexpr double kTurnsApart = 0.32;  // [rad] of which any two are turned against each other by so much

/// What a search looks at, and how finely.
struct Resolution {
  double farthest = 20.0;  ///< [m] points beyond tell too little at such steps …
  double cell = 0.1;       ///< [m] … in x and y
  double yaw = 0.04;       ///< [rad]: half a metre off at 12 m are two steps

  static constexpr int kCells = 200;  ///< from the origin to the farthest

  /// In a hall with most walls beyond that the cells are larger, and the turns finer, as walls so far away need.
  explicit Resolution(const std::vector<Eigen::Vector2d>& reference) {
    if (reference.empty()) return;
    constexpr double kAround = 1.3;  // of the median distance
    constexpr double kLargest = 4.0;
    std::vector<double> distances;
    for (const Eigen::Vector2d& point : reference) distances.push_back(point.norm());
    const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
    std::nth_element(distances.begin(), middle, distances.end());
    if (*middle <= farthest) return;
    const double scale = std::min(kAround * *middle / farthest, kLargest);
    farthest *= scale;
    cell *= scale;
    yaw /= scale;
  }
};

struct Cell {
  int column;
  int row;
};

Cell cellOf(const Eigen::Vector2d& point, double size) {
  return {static_cast<int>(std::lround(point.x() / size)), static_cast<int>(std::lround(point.y() / size))};
}

/// How near a cell is to a point of a scan, 0 to kOnIt; or of a block of cells, the nearest.
class NearnessGrid {
 public:
  static constexpr std::uint8_t kOnIt = 4;

  /// block: cells to a side. A block is named by the cell in it with the least column and row.
  NearnessGrid(const std::vector<Eigen::Vector2d>& points, const Resolution& resolution, int block) {
    const int first = -kReach - (block - 1);
    for (const Eigen::Vector2d& point : points) {
      if (point.norm() > resolution.farthest) continue;
      const Cell cell = cellOf(point, resolution.cell);
      for (int row = first; row <= kReach; ++row) {
        for (int column = first; column <= kReach; ++column) {
          const int away = std::max(cellsAway(column, block), cellsAway(row, block));
          auto& nearness = nearness_[index(cell.column + column, cell.row + row)];
          nearness = std::max(nearness, static_cast<std::uint8_t>(kOnIt - 1.5 * away));
        }
      }
    }
  }

  /// Of all cells, those that are moved by so many columns and rows.
  int sum(const std::vector<Cell>& cells, int columns, int rows) const {
    int sum = 0;
    for (const Cell& cell : cells) sum += at(cell.column + columns, cell.row + rows);
    return sum;
  }

 private:
  static constexpr int kReach = 2;
  static constexpr int kHalf = Resolution::kCells + kReach + kBlock;
  static constexpr int kWidth = 2 * kHalf + 1;

  /// Along one axis, of a block that begins so many cells beside a point.
  static int cellsAway(int offset, int block) { return std::max({0, offset, 1 - block - offset}); }

  static std::size_t index(int column, int row) {
    return static_cast<std::size_t>((row + kHalf) * kWidth + column + kHalf);
  }

  int at(int column, int row) const {
    const bool inside = std::abs(column) <= kHalf && std::abs(row) <= kHalf;
    return inside ? nearness_[index(column, row)] : 0;
  }

  std::vector<std::uint8_t> nearness_ = std::vector<std::uint8_t>(kWidth * kWidth, 0);
};

std::vector<Eigen::Vector2d> evenlyTaken(const std::vector<Eigen::Vector2d>& points) {
  const std::size_t every = (points.size() + kPoints - 1) / kPoints;
  std::vector<Eigen::Vector2d> taken;
  for (std::size_t i = 0; i < points.size(); i += every) taken.push_back(points[i]);
  return taken;
}

/// The search: the places of one turn after the other, in blocks. No place in a block has a better score than the sum
/// over the cells' nearest of the block, less the price of the one that is nearest to the prediction.
class WideSearch {
 public:
  WideSearch(const PreparedScan& reference, const PreparedScan& current, const SE2& predicted,
             const WideSearchOptions& options, double price)
      : resolution_(reference.points.point),
        by_cell_(reference.points.point, resolution_, 1),
        by_block_(reference.points.point, resolution_, kBlock),
        points_(evenlyTaken(current.points.point)),
        predicted_(predicted),
        turns_(static_cast<int>(options.yaw / resolution_.yaw)),
        steps_(static_cast<int>(options.translation / resolution_.cell)),
        price_(price),
        cells_(points_.size()) {}

  /// The best places of those turns at which it is better than at the turns beside, the best first.
  std::vector<SE2> bestPlaces() {
    const auto apart = static_cast<int>(std::lround(kTurnsApart / resolution_.yaw));
    std::vector<Place> of_turns;
    for (int turn = -turns_; turn <= turns_; ++turn) of_turns.push_back(bestOfTurn(turn));
    std::sort(of_turns.begin(), of_turns.end(), [](const Place& a, const Place& b) { return a.score > b.score; });
    std::vector<SE2> best;
    std::vector<int> turns;
    for (const Place& place : of_turns) {
      const bool beside_better =
          std::any_of(turns.begin(), turns.end(), [&](int turn) { return std::abs(turn - place.turn) < apart; });
      if (beside_better) continue;
      turns.push_back(place.turn);
      best.emplace_back(predicted_.x + place.column * resolution_.cell, predicted_.y + place.row * resolution_.cell,
                        predicted_.yaw + place.turn * resolution_.yaw);
      if (best.size() == kPlaces) break;
    }
    return best;
  }

 private:
  struct Place {
    double score;
    int turn;
    int column;
    int row;
  };

  Place bestOfTurn(int turn) {
    const RigidMotion motion({predicted_.x, predicted_.y, predicted_.yaw + turn * resolution_.yaw});
    for (std::size_t k = 0; k < points_.size(); ++k) cells_[k] = cellOf(motion * points_[k], resolution_.cell);
    Place best{by_cell_.sum(cells_, 0, 0) - priceOf(turn, 0, 0), turn, 0, 0};
    for (int row = -steps_; row <= steps_; row += kBlock) {
      for (int column = -steps_; column <= steps_; column += kBlock) {
        const double price = priceOf(turn, nearestTo0(column), nearestTo0(row));
        if (by_block_.sum(cells_, column, row) - price > best.score) improve(best, column, row);
      }
    }
    return best;
  }

  /// By the cells of a block.
  void improve(Place& best, int column, int row) const {
    for (int y = row; y < std::min(row + kBlock, steps_ + 1); ++y) {
      for (int x = column; x < std::min(column + kBlock, steps_ + 1); ++x) {
        const double score = by_cell_.sum(cells_, x, y) - priceOf(best.turn, x, y);
        if (score > best.score) best = {score, best.turn, x, y};
      }
    }
  }

  double priceOf(int turn, int column, int row) const {
    const double away = resolution_.cell * resolution_.cell * (column * column + row * row) +
                        resolution_.yaw * resolution_.yaw * turn * turn;
    return price_ * away * NearnessGrid::kOnIt * static_cast<double>(points_.size());
  }

  /// Of the cells of a block along an axis.
  static int nearestTo0(int first) { return std::clamp(0, first, first + kBlock - 1); }

  Resolution resolution_;
  NearnessGrid by_cell_;
  NearnessGrid by_block_;
  std::vector<Eigen::Vector2d> points_;
  SE2 predicted_;
  int turns_;
  int steps_;
  double price_;
  std::vector<Cell> cells_;  // of the points, turned
};

}  // namespace

std::vector<SE2> widelySearched(const PreparedScan& reference, const PreparedScan& current, const SE2& predicted,
                                const WideSearchOptions& options, double price) {
  return WideSearch(reference, current, predicted, options, price).bestPlaces();
}

}  // namespace sckf
