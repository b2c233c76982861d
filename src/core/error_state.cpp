#include "sckf_odometry/core/error_state.h"

#include <Eigen/Cholesky>
#include <algorithm>

#include "sckf_odometry/core/covariance.h"

namespace sckf {

using Eigen::MatrixXd;

ErrorState::Part ErrorState::place(Index size) {
  const auto gap = std::find_if(gaps_.begin(), gaps_.end(), [size](const Part& part) { return part.size == size; });
  if (gap != gaps_.end()) {
    const Part part = *gap;
    gaps_.erase(gap);
    return part;
  }
  const Part part{P_.rows(), size};
  P_.conservativeResize(P_.rows() + size, P_.cols() + size);
  P_.bottomRows(size).setZero();
  P_.rightCols(size).setZero();
  for (auto& [scan, noise] : ranges_) {
    noise.coordinates.conservativeResize(Eigen::NoChange, P_.rows());
    noise.coordinates.rightCols(size).setZero();
  }
  return part;
}

ErrorState::Part ErrorState::add(const MatrixXd& covariance) {
  const Part part = place(covariance.rows());
  P_.block(part.row, part.row, part.size, part.size) = covariance;
  return part;
}

ErrorState::Part ErrorState::addCloneOf(Part part) {
  const Part clone = place(part.size);
  P_.middleRows(clone.row, clone.size) = P_.middleRows(part.row, part.size);
  P_.middleCols(clone.row, clone.size) = P_.middleCols(part.row, part.size);
  for (auto& [scan, noise] : ranges_) {
    noise.coordinates.middleCols(clone.row, clone.size) = noise.coordinates.middleCols(part.row, part.size);
  }
  return clone;
}

void ErrorState::remove(Part part) {
  P_.middleRows(part.row, part.size).setZero();
  P_.middleCols(part.row, part.size).setZero();
  for (auto& [scan, noise] : ranges_) noise.coordinates.middleCols(part.row, part.size).setZero();
  gaps_.push_back(part);
}

ErrorState::Ranges ErrorState::addRanges(const Eigen::VectorXd& variances) {
  ranges_[next_ranges_] = {variances, MatrixXd(variances.size(), 0), MatrixXd(0, P_.rows())};
  return next_ranges_++;
}

void ErrorState::move(Part part, const MatrixXd& B, Part by) {
  P_.middleRows(part.row, part.size) += B * P_.middleRows(by.row, by.size);
  P_.middleCols(part.row, part.size) += P_.middleCols(by.row, by.size) * B.transpose();
  for (auto& [scan, noise] : ranges_) {
    noise.coordinates.middleCols(part.row, part.size) += noise.coordinates.middleCols(by.row, by.size) * B.transpose();
  }
}

void ErrorState::disturb(Part part, const MatrixXd& Q) { P_.block(part.row, part.row, part.size, part.size) += Q; }

MatrixXd ErrorState::Correlation::gain(Part part) const {
  return innovation.llt().solve(state.middleRows(part.row, part.size).transpose()).transpose();
}

/// C Hᵀ, q × d: what r has of the directions by the state.
MatrixXd ErrorState::coordinates(const RangeNoise& noise, const Measurement& m) {
  MatrixXd of_r = MatrixXd::Zero(noise.coordinates.rows(), m.residual.size());
  for (const auto& [part, H] : m.terms) {
    of_r.noalias() += noise.coordinates.middleCols(part.row, part.size) * H.transpose();
  }
  return of_r;
}

/// E{z̃ rᵀ} of the range noise of a scan, M × d.
MatrixXd ErrorState::correlate(const RangeNoise& noise, Ranges scan, const Measurement& m) {
  MatrixXd P_zr = noise.directions * coordinates(noise, m);
  for (const auto& [used, J] : m.ranges) {
    if (used == scan) P_zr.noalias() += noise.variances.asDiagonal() * J.transpose();
  }
  return P_zr;
}

ErrorState::Correlation ErrorState::correlate(const Measurement& m) const {
  Correlation out{MatrixXd::Zero(P_.rows(), m.residual.size()), m.noise};
  for (const auto& [part, H] : m.terms) out.state.noalias() += P_.middleCols(part.row, part.size) * H.transpose();
  for (const auto& [scan, J] : m.ranges) {
    const RangeNoise& noise = ranges_.at(scan);
    const MatrixXd J_D = J * noise.directions;
    out.state.noalias() += noise.coordinates.transpose() * J_D.transpose();
  }
  for (const auto& [part, H] : m.terms) out.innovation.noalias() += H * out.state.middleRows(part.row, part.size);
  for (const auto& [scan, J] : m.ranges) out.innovation.noalias() += J * correlate(ranges_.at(scan), scan, m);
  out.innovation = symmetric(out.innovation);
  return out;
}

void ErrorState::addDirections(RangeNoise& noise, const MatrixXd& directions, const MatrixXd& coordinates) {
  const Index q = noise.directions.cols() + directions.cols();
  noise.directions.conservativeResize(Eigen::NoChange, q);
  noise.directions.rightCols(directions.cols()) = directions;
  noise.coordinates.conservativeResize(q, Eigen::NoChange);
  noise.coordinates.bottomRows(coordinates.rows()) = coordinates;
  const Index N = noise.coordinates.cols();
  if (q <= 2 * N) return;
  noise.directions *= noise.coordinates;  // N are enough; at twice as many it is seldom that they are put together
  noise.coordinates.setIdentity(N, N);
}

std::vector<Eigen::VectorXd> ErrorState::update(const Measurement& m, const std::vector<Part>& corrected) {
  const Correlation with_r = correlate(m);
  MatrixXd K = MatrixXd::Zero(P_.rows(), m.residual.size());
  std::vector<Eigen::VectorXd> corrections;
  for (const Part& part : corrected) {
    K.middleRows(part.row, part.size) = with_r.gain(part);
    corrections.emplace_back(K.middleRows(part.row, part.size) * m.residual);
  }
  for (auto& [scan, noise] : ranges_) {
    const MatrixXd of_r = coordinates(noise, m);
    for (const Part& part : corrected) {
      noise.coordinates.middleCols(part.row, part.size).noalias() -=
          of_r * K.middleRows(part.row, part.size).transpose();
    }
  }
  for (const auto& [scan, J] : m.ranges) {
    RangeNoise& noise = ranges_.at(scan);
    addDirections(noise, noise.variances.asDiagonal() * J.transpose(), -K.transpose());
  }
  const MatrixXd K_P_rx = K * with_r.state.transpose();
  P_ = symmetric(P_ - K_P_rx - K_P_rx.transpose() + K * with_r.innovation * K.transpose());
  return corrections;
}

}  // namespace sckf
