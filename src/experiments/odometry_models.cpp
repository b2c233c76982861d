#include "sckf_odometry/experiments/odometry_models.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>

#include "sckf_odometry/core/dead_reckoning.h"
#include "sckf_odometry/experiments/random_draws.h"

namespace sckf {

namespace {

/// A short piece of way with its rotation.
struct Piece {
  double way = 0.0;
  double rotation = 0.0;

  SE2 motion() const { return {way * std::cos(0.5 * rotation), way * std::sin(0.5 * rotation), rotation}; }
};

/// Straight on, a bend to the left, straight on, one to the right, each of 3 m; on the spot in between, if allowed.
std::vector<Piece> drive(double step, bool turns_on_the_spot) {
  constexpr double kLength = 3.0;  // [m]
  std::vector<Piece> pieces;
  for (const double curvature : {0.0, 0.8, 0.0, -0.8}) {
    for (double way = 0.0; way < kLength; way += step) pieces.push_back({step, curvature * step});
    if (!turns_on_the_spot) continue;
    for (double angle = 0.0; angle < 0.5 * M_PI; angle += step) pieces.push_back({0.0, step});
  }
  return pieces;
}

/// A kind of wheels: the numbers of its noise, and the motion that is made where a piece is told.
struct Robot {
  OdometryNoise noise;
  std::function<SE2(const Piece&, RandomDraws&)> made;
};

double root(double length) { return std::sqrt(std::abs(length)); }

/// Wheels that roll in every direction, and slip in each alike.
Robot omnidirectional() {
  OdometryNoise noise;
  noise.translation_per_meter = noise.translation_per_radian = 0.03;
  noise.yaw_per_meter = noise.yaw_per_radian = 0.01;
  return {noise, [noise](const Piece& piece, RandomDraws& random) {
            const double translation =
                noise.translation_per_meter * root(std::abs(piece.way) + std::abs(piece.rotation));
            const double yaw = noise.yaw_per_meter * root(std::abs(piece.way) + std::abs(piece.rotation));
            const SE2 told = piece.motion();
            return SE2(told.x + translation * random.gaussian(), told.y + translation * random.gaussian(),
                       told.yaw + yaw * random.gaussian());
          }};
}

/// Two wheels, each with a noise of its own that grows with its way.
Robot differential() {
  constexpr double kBase = 0.5;        // [m] between the wheels
  constexpr double kPerWheel = 0.004;  // [m/√m]
  OdometryNoise noise;
  noise.translation_per_meter = kPerWheel / std::sqrt(2.0);
  noise.translation_per_radian = 0.5 * kPerWheel * std::sqrt(kBase);
  noise.yaw_per_meter = kPerWheel * std::sqrt(2.0) / kBase;
  noise.yaw_per_radian = kPerWheel / std::sqrt(kBase);
  noise.lateral_share = 0.0;
  return {noise, [](const Piece& piece, RandomDraws& random) {
            const auto wheel = [&](double way) { return way + kPerWheel * root(way) * random.gaussian(); };
            const double right = wheel(piece.way + 0.5 * kBase * piece.rotation);
            const double left = wheel(piece.way - 0.5 * kBase * piece.rotation);
            return Piece{0.5 * (right + left), (right - left) / kBase}.motion();
          }};
}

/// A car: the curvature is steered, with a noise of its own, and the way is measured.
Robot ackermann() {
  OdometryNoise noise;
  noise.translation_per_meter = 0.05;
  noise.yaw_per_meter = 0.01;
  noise.yaw_per_radian = 0.0;
  noise.lateral_share = 0.0;
  return {noise, [noise](const Piece& piece, RandomDraws& random) {
            const double way = piece.way + noise.translation_per_meter * root(piece.way) * random.gaussian();
            const double curvature = piece.rotation / piece.way;
            return Piece{way, curvature * way + noise.yaw_per_meter * root(piece.way) * random.gaussian()}.motion();
          }};
}

/// The way by a model: poses and covariance as a filter has them, told in increments.
DeadReckoning toldBy(const std::vector<Piece>& pieces, const OdometryNoise& noise, int steps_told) {
  DeadReckoning told(SE2(), Eigen::Matrix3d::Zero());
  SE2 increment;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    increment = compose(increment, pieces[i].motion());
    if ((i + 1) % static_cast<std::size_t>(steps_told) != 0 && i + 1 != pieces.size()) continue;
    told.propagate(modelledIncrement(increment, noise));
    increment = SE2();
  }
  return told;
}

OdometryModelsRow compare(const Robot& robot, const std::string& model, const std::vector<Piece>& pieces,
                          const OdometryModelsOptions& options) {
  OdometryNoise noise = robot.noise;
  noise.model = model;
  const DeadReckoning told = toldBy(pieces, noise, options.steps_told);
  const Eigen::Matrix3d P = told.covariance();
  const Eigen::LDLT<Eigen::Matrix3d> solver(P);
  OdometryModelsRow row;
  row.model = model;
  for (int run = 0; run < options.runs; ++run) {
    RandomDraws random(options.seed + static_cast<std::uint64_t>(run));
    SE2 truth;
    for (const Piece& piece : pieces) truth = compose(truth, robot.made(piece, random));
    const Eigen::Vector3d e = error(truth, told.pose());
    row.nees += e.dot(solver.solve(e)) / options.runs;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(P.topLeftCorner<2, 2>(), Eigen::EigenvaluesOnly);
  row.smallest_std = std::sqrt(eigen.eigenvalues()(0));
  row.largest_std = std::sqrt(eigen.eigenvalues()(1));
  return row;
}

}  // namespace

std::vector<OdometryModelsRow> simulateOdometryModels(const OdometryModelsOptions& options,
                                                      const std::function<void()>& tick) {
  const std::vector<Robot> robots{omnidirectional(), differential(), ackermann()};
  std::vector<OdometryModelsRow> rows;
  for (std::size_t i = 0; i < robots.size(); ++i) {
    const std::string& kind = odometryModelNames()[i];
    const std::vector<Piece> pieces = drive(options.step, kind != "ackermann");
    for (const std::string& model : odometryModelNames()) {
      rows.push_back(compare(robots[i], model, pieces, options));
      rows.back().robot = kind;
      tick();
    }
  }
  return rows;
}

}  // namespace sckf
