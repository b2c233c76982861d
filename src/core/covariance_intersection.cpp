#include "sckf_odometry/core/covariance_intersection.h"

#include <Eigen/Cholesky>
#include <boost/math/tools/minima.hpp>

#include "sckf_odometry/core/covariance.h"

namespace sckf {

namespace {

// ω stays off the ends, where the covariances are infinite.
constexpr double kSmallestWeight = 1e-9;

}  // namespace

CovarianceIntersection intersectCovariances(const Eigen::Matrix3d& P,
                                            const Eigen::Matrix<double, Eigen::Dynamic, 3, 0, 3, 3>& H,
                                            const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>& R,
                                            double omega) {
  const Eigen::Matrix3d P_inflated = P / omega;
  const Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3> P_Ht = P_inflated * H.transpose();
  const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3> S = H * P_Ht + R / (1.0 - omega);
  CovarianceIntersection result;
  result.omega = omega;
  result.gain = S.llt().solve(P_Ht.transpose()).transpose();
  const Eigen::Matrix3d A = Eigen::Matrix3d::Identity() - result.gain * H;
  result.covariance =
      symmetric(A * P_inflated * A.transpose() + result.gain * (R / (1.0 - omega)) * result.gain.transpose());
  return result;
}

CovarianceIntersection intersectCovariances(const Eigen::Matrix3d& P,
                                            const Eigen::Matrix<double, Eigen::Dynamic, 3, 0, 3, 3>& H,
                                            const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>& R) {
  // The trace of the inverse of a sum of matrices linear in ω is convex in ω: what is found is the minimum.
  const auto trace = [&](double omega) { return intersectCovariances(P, H, R, omega).covariance.trace(); };
  constexpr int kBits = 26;  // half of a double's: a minimum is not known better than to the root of the precision
  const double omega =
      boost::math::tools::brent_find_minima(trace, kSmallestWeight, 1.0 - kSmallestWeight, kBits).first;
  return intersectCovariances(P, H, R, omega);
}

}  // namespace sckf
