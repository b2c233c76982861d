#include "core/matrix_matchers.h"

#include <Eigen/Eigenvalues>
#include <algorithm>

namespace sckf {

::testing::AssertionResult matricesNear(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, double tolerance) {
  const bool same_shape = a.rows() == b.rows() && a.cols() == b.cols();
  if (same_shape && ((a - b).array().abs() <= tolerance).all()) return ::testing::AssertionSuccess();
  ::testing::AssertionResult failure = ::testing::AssertionFailure();
  failure << "left, " << a.rows() << " x " << a.cols() << ":\n" << a << "\n";
  failure << "right, " << b.rows() << " x " << b.cols() << ":\n" << b << "\n";
  if (same_shape) failure << "left - right, tolerance " << tolerance << ":\n" << (a - b).eval();
  return failure;
}

::testing::AssertionResult matricesClose(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b,
                                         double relative_tolerance) {
  const auto largest = [](const Eigen::MatrixXd& m) { return m.size() == 0 ? 0.0 : m.cwiseAbs().maxCoeff(); };
  return matricesNear(a, b, relative_tolerance * std::max(largest(a), largest(b)));
}

double smallestEigenvalue(const Eigen::MatrixXd& symmetric) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(symmetric, Eigen::EigenvaluesOnly).eigenvalues()(0);
}

}  // namespace sckf
