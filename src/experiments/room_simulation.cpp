#include "sckf_odometry/experiments/room_simulation.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>

namespace sckf {

namespace {

constexpr double kMatchingStd = 1e-3;  // of n, in every direction [m, rad]

/// In base_link.
Eigen::Vector2d beamDirection(int beam) {
  const double angle = 2.0 * M_PI * beam / RoomSimulation::kBeams;
  return {std::cos(angle), std::sin(angle)};
}

/// The beam of the scan that ended nearest to the point (in the scan's base_link) on the wall; −1 if none did.
int nearestBeam(const SimulatedScan& scan, const Eigen::Vector2d& point, int wall) {
  int nearest = -1;
  double nearest_distance = std::numeric_limits<double>::infinity();
  for (int beam = 0; beam < RoomSimulation::kBeams; ++beam) {
    const double distance = (scan.points[beam] - point).norm();
    if (scan.wall[beam] == wall && distance < nearest_distance) {
      nearest = beam;
      nearest_distance = distance;
    }
  }
  return nearest;
}

}  // namespace

std::vector<StraightWall> simulatedHall() { return {{{1, 0}, 8.0}, {{-1, 0}, 8.0}, {{0, 1}, 7.0}, {{0, -1}, 7.0}}; }

std::vector<StraightWall> simulatedCorridor() { return {{{0, 1}, 2.0}, {{0, -1}, 2.0}}; }

SimulatedScan RoomSimulation::scan(const SE2& odom_from_base, RandomDraws& random) const {
  SimulatedScan scan;
  scan.odom_from_base = odom_from_base;
  scan.noise = range_std_ * random.gaussian(kBeams);
  scan.variance = Eigen::VectorXd::Constant(kBeams, range_std_ * range_std_);
  for (int beam = 0; beam < kBeams; ++beam) {
    double range = kMaxRange;
    int hit = -1;
    for (std::size_t i = 0; i < walls_.size(); ++i) {
      const double approach = walls_[i].normal.dot(odom_from_base.rotation() * beamDirection(beam));
      const double distance = walls_[i].distance - walls_[i].normal.dot(odom_from_base.translation());
      if (approach > 0.0 && distance / approach < range) {
        range = distance / approach;
        hit = static_cast<int>(i);
      }
    }
    scan.wall.push_back(hit);
    scan.points.push_back(range * beamDirection(beam));
  }
  return scan;
}

RoomSimulation::Problem RoomSimulation::problem(const SimulatedScan& reference, const SimulatedScan& current) const {
  const SE2 reference_from_current = between(reference.odom_from_base, current.odom_from_base);
  Problem p{Eigen::MatrixXd::Zero(kBeams, 3), std::vector<int>(kBeams, -1), Eigen::VectorXd::Zero(kBeams),
            Eigen::VectorXd::Zero(kBeams)};
  for (int beam = 0; beam < kBeams; ++beam) {
    if (current.wall[beam] < 0) continue;
    const Eigen::Vector2d point = reference_from_current * current.points[beam];
    const int partner = nearestBeam(reference, point, current.wall[beam]);
    if (partner < 0) continue;
    const Eigen::Vector2d normal =
        reference.odom_from_base.rotation().transpose() * walls_[current.wall[beam]].normal;  // in the reference
    const Eigen::Vector2d lever = point - reference_from_current.translation();
    p.A.row(beam) << normal.transpose(), normal.dot(Eigen::Vector2d(-lever.y(), lever.x()));
    p.partner[beam] = partner;
    p.by_reference(beam) = -normal.dot(beamDirection(partner));
    p.by_current(beam) = normal.dot(reference_from_current.rotation() * beamDirection(beam));
  }
  return p;
}

Displacement RoomSimulation::match(const SimulatedScan& reference, const SimulatedScan& current,
                                   RandomDraws& random) const {
  const Problem p = problem(reference, current);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> information(p.A.transpose() * p.A);
  const int d = static_cast<int>((information.eigenvalues().array() > 1e-9 * information.eigenvalues()(2)).count());
  const Eigen::MatrixXd V_o = information.eigenvectors().rightCols(d);
  const Eigen::MatrixXd A = p.A * V_o;
  const Eigen::MatrixXd solve = (A.transpose() * A).llt().solve(A.transpose());

  Displacement z;
  z.observable = V_o.transpose();
  z.J_reference = Eigen::MatrixXd::Zero(d, kBeams);
  for (int beam = 0; beam < kBeams; ++beam) {
    if (p.partner[beam] >= 0) z.J_reference.col(p.partner[beam]) -= p.by_reference(beam) * solve.col(beam);
  }
  z.J_current = -solve * p.by_current.asDiagonal();
  z.variance_reference = reference.variance;
  z.variance_current = current.variance;
  z.matching_noise = kMatchingStd * kMatchingStd * Eigen::MatrixXd::Identity(d, d);
  const Eigen::VectorXd seen_error =
      z.J_reference * reference.noise + z.J_current * current.noise + kMatchingStd * random.gaussian(d);
  const Eigen::VectorXd made_up = 0.2 * random.gaussian(3 - d);
  z.reference_from_current = corrected(between(reference.odom_from_base, current.odom_from_base),
                                       V_o * seen_error + information.eigenvectors().leftCols(3 - d) * made_up);
  return z;
}

}  // namespace sckf
