// Whether normalised errors are as large as a covariance says.
#pragma once

#include <gtest/gtest.h>

#include <boost/math/distributions/chi_squared.hpp>
#include <cstddef>
#include <string>
#include <vector>

namespace sckf {

/// Where the mean over the runs of a χ² with d degrees of freedom lies, but for once in a thousand times.
struct ChiSquaredBand {
  ChiSquaredBand(int d, int runs) {
    const boost::math::chi_squared sum(static_cast<double>(runs * d));
    low = boost::math::quantile(sum, 0.0005) / runs;
    high = boost::math::quantile(sum, 0.9995) / runs;
  }
  double low, high;
};

/// means: over the runs, of squared normalised errors with d degrees of freedom, one entry per scan.
inline void expectInBand(const std::vector<double>& means, const ChiSquaredBand& band, const std::string& what) {
  for (std::size_t scan = 10; scan < means.size(); scan += 10) {
    EXPECT_GT(means[scan], band.low) << what << " at scan " << scan << ": the covariance is too large";
    EXPECT_LT(means[scan], band.high) << what << " at scan " << scan << ": the covariance is too small";
  }
}

}  // namespace sckf
