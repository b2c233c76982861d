// What one update costs, by the number of ranges of a scan and by what is in the state.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "sckf_odometry/core/joint_covariance.h"

namespace sckf {

/// Best of several times of innovation, update and new clone [s]. Zero: not measured.
struct UpdateTimes {
  int ranges = 0;
  double sckf = 0.0;
  double sckf_nc = 0.0;  ///< given the displacement's covariance (3 × 3), which is all that it needs of the scans
  double dense = 0.0;    ///< with the covariance of (5) as one matrix
};

/// The update of the whole covariance of (5), (6 + M)², as a textbook writes it: P ← P − K H P. What an implementation
/// without the structure of the problem would do, and quadratic in M.
void denseUpdate(const Eigen::MatrixXd& H, const Eigen::MatrixXd& noise, Eigen::MatrixXd& P);

/// The dense update is measured up to max_dense_ranges: its memory grows with the square as well. tick: after each.
std::vector<UpdateTimes> measureUpdates(const std::vector<int>& ranges, int max_dense_ranges,
                                        const std::function<void()>& tick);

/// What is in the state of the filter with several clones, each with the range noise of its scan.
struct StateSize {
  int clones = 2;     ///< 1 and more
  int landmarks = 0;  ///< beside them
  int ranges = 360;   ///< of a scan

  int states() const { return 3 * (1 + clones + landmarks); }  ///< N
};

/// Best of several times of innovation and update [s] by a displacement from the oldest clone, which corrects all
/// states.
std::vector<double> measureUpdates(const std::vector<StateSize>& sizes, const std::function<void()>& tick);

}  // namespace sckf
