#include "sckf_odometry/core/covariance.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>
#include <sstream>

namespace sckf {

bool isCovariance(const Eigen::Matrix3d& P) {
  constexpr double kTolerance = 1e-9;  // relative
  if (!P.allFinite()) return false;
  const double scale = P.cwiseAbs().maxCoeff();
  if ((P - P.transpose()).cwiseAbs().maxCoeff() > kTolerance * scale) return false;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(P, Eigen::EigenvaluesOnly);
  return eigen.eigenvalues().minCoeff() >= -kTolerance * scale;
}

bool isPositiveDefinite(const Eigen::Matrix3d& P) {
  if (!isCovariance(P)) return false;
  const Eigen::LLT<Eigen::Matrix3d> factor(P);
  return factor.info() == Eigen::Success && factor.rcond() > 1e-12;
}

Eigen::Matrix3d withYawUpToATurn(const Eigen::Matrix3d& covariance) {
  constexpr double kTurn = 6.28;  // [rad]
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();
  if (covariance(2, 2) > kTurn * kTurn) scale(2) = kTurn / std::sqrt(covariance(2, 2));
  return scale.asDiagonal() * covariance * scale.asDiagonal();
}

std::string problemOf(const SE2& pose, const Eigen::Matrix3d& covariance) {
  constexpr double kLargest = 1e9;  // beyond, doubles tell centimetres no more
  const Eigen::IOFormat in_a_row(Eigen::StreamPrecision, Eigen::DontAlignCols, ", ", "; ");
  const Eigen::Vector3d values = pose.vector();
  std::ostringstream problem;
  if (!values.allFinite() || values.cwiseAbs().maxCoeff() > kLargest) {
    problem << "pose is (" << values.transpose().format(in_a_row) << "): expected finite values up to " << kLargest;
  } else if (!isCovariance(covariance) || covariance.cwiseAbs().maxCoeff() > kLargest) {
    problem << "covariance of the pose is [" << covariance.format(in_a_row)
            << "]: expected a symmetric, positive semi-definite matrix of finite values up to " << kLargest;
  }
  return problem.str();
}

double normalisedSquare(const Eigen::VectorXd& e, const Eigen::MatrixXd& P) {
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  const Eigen::LLT<Eigen::MatrixXd> factor(P);
  if (factor.info() != Eigen::Success) return kInfinite;
  const double square = e.dot(factor.solve(e));
  return square >= 0.0 ? square : kInfinite;
}

Eigen::MatrixXd carriedOver(const Eigen::MatrixXd& J, const Eigen::VectorXd& variances) {
  // Entry by entry: a matrix product of so few rows spends its time on anything but multiplying.
  Eigen::MatrixXd P(J.rows(), J.rows());
  for (Eigen::Index i = 0; i < J.rows(); ++i) {
    for (Eigen::Index k = 0; k <= i; ++k) {
      P(i, k) = P(k, i) = (J.row(i).array() * variances.transpose().array() * J.row(k).array()).sum();
    }
  }
  return P;
}

}  // namespace sckf
