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
    // eval: a part may be moved by itself.
    noise.coordinates.middleCols(part.row, part.size) +=
        noise.coordinates.middleCols(by.row, by.size).lazyProduct(B.transpose()).eval();
  }
}

void ErrorState::disturb(Part part, const MatrixXd& Q) { P_.block(part.row, part.row, part.size, part.size) += Q; }

MatrixXd ErrorState::Correlation::gainOf(const MatrixXd& rows) const {
  return innovation.llt().solve(rows.transpose()).transpose();
}

/// C Hᵀ, q × d: what r has of the directions by the state.
MatrixXd ErrorState::coordinates(const RangeNoise& noise, const Measurement& m) {
  MatrixXd of_r = MatrixXd::Zero(noise.coordinates.rows(), m.residual.size());
  for (const auto& [part, H] : m.terms) {
    of_r.noalias() += noise.coordinates.middleCols(part.row, part.size) * H.transpose();
  }
  return of_r;
}

ErrorState::Correlation ErrorState::correlate(const Measurement& m) const {
  Correlation out{MatrixXd::Zero(P_.rows(), m.residual.size()), m.noise};
  for (const auto& [part, H] : m.terms) out.state.noalias() += P_.middleCols(part.row, part.size) * H.transpose();
  for (const auto& [scan, J] : m.ranges) {
    const RangeNoise& noise = ranges_.at(scan);
    const MatrixXd J_D = J * noise.directions;
    out.state.noalias() += noise.coordinates.transpose() * J_D.transpose();
    out.innovation += carriedOver(J, noise.variances);
    out.innovation.noalias() += J_D * coordinates(noise, m);
  }
  for (const auto& [part, H] : m.terms) out.innovation.noalias() += H * out.state.middleRows(part.row, part.size);
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

void ErrorState::update(const Measurement& m, const Correlation& with_r, const std::vector<Gain>& gains) {
  if (gains.empty()) return;
  MatrixXd K = MatrixXd::Zero(P_.rows(), m.residual.size());
  Index first = P_.rows();  // of the rows that are corrected …
  Index end = 0;            // … and after the last
  for (const auto& [part, gain] : gains) {
    K.middleRows(part.row, part.size) = gain;
    first = std::min(first, part.row);
    end = std::max(end, part.row + part.size);
  }
  for (auto& [scan, noise] : ranges_) {
    auto of_corrected = noise.coordinates.middleCols(first, end - first);
    of_corrected.noalias() -= coordinates(noise, m) * K.middleRows(first, end - first).transpose();
  }
  for (const auto& [scan, J] : m.ranges) {
    RangeNoise& noise = ranges_.at(scan);
    addDirections(noise, noise.variances.asDiagonal() * J.transpose(), -K.transpose());
  }
  // P − K P_rx − P_xr Kᵀ + K S Kᵀ, one half of it
  const MatrixXd P_xr = with_r.state - 0.5 * K * with_r.innovation;
  for (Index i = 0; i < K.cols(); ++i) P_.selfadjointView<Eigen::Lower>().rankUpdate(K.col(i), P_xr.col(i), -1.0);
  P_.triangularView<Eigen::StrictlyUpper>() = P_.transpose();
}

}  // namespace sckf
