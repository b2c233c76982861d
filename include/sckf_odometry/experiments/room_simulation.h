// A robot with wheels and a laser between straight walls, with every error drawn from the noise that the filter is
// told.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sckf_odometry/core/displacement.h"
#include "sckf_odometry/core/se2.h"
#include "sckf_odometry/experiments/random_draws.h"

namespace sckf {

/// The line normalᵀ p = distance in odom; the robot is on the side of the origin.
struct StraightWall {
  Eigen::Vector2d normal;
  double distance;
};

/// A hall of 16 m × 14 m around the origin, and two walls along x, 4 m apart, that never end.
std::vector<StraightWall> simulatedHall();
std::vector<StraightWall> simulatedCorridor();

/// One scan: where its beams really ended, and the range noise z̃ that all displacements made with it share.
struct SimulatedScan {
  SE2 odom_from_base;
  std::vector<int> wall;                // per beam, −1 if it met nothing
  std::vector<Eigen::Vector2d> points;  // per beam, in base_link
  Eigen::VectorXd noise;                // z̃ [m]
  Eigen::VectorXd variance;             // diagonal of R [m²]
};

class RoomSimulation {
 public:
  static constexpr int kBeams = 60;
  static constexpr double kMaxRange = 20.0;  // [m]

  RoomSimulation(std::vector<StraightWall> walls, double range_std) : walls_(std::move(walls)), range_std_(range_std) {}

  SimulatedScan scan(const SE2& odom_from_base, RandomDraws& random) const;

  /// The displacement that least squares of e_i = nᵢᵀ (R pᵢ + t − qᵢ) finds, to first order in the noise: pᵢ a point of
  /// the current scan, qᵢ the nearest point of the reference on the same wall. Directions that the walls leave open
  /// are not observable, and what the displacement says about them is made up.
  Displacement match(const SimulatedScan& reference, const SimulatedScan& current, RandomDraws& random) const;

 private:
  struct Problem {                 // a row for each beam of the current scan, of zeros if it has no partner
    Eigen::MatrixXd A;             // ∂e/∂displacement, beams × 3
    std::vector<int> partner;      // the beam of the reference, −1: none
    Eigen::VectorXd by_reference;  // ∂e/∂z_k of the partner; by all other ranges it is zero
    Eigen::VectorXd by_current;    // ∂e/∂z_{k+m} of the beam itself
  };
  Problem problem(const SimulatedScan& reference, const SimulatedScan& current) const;

  std::vector<StraightWall> walls_;
  double range_std_;
};

}  // namespace sckf
