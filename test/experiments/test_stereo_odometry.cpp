#include <gtest/gtest.h>

#include <cmath>

#include "core/matrix_matchers.h"
#include "core/random_inputs.h"
#include "sckf_odometry/experiments/stereo_odometry.h"
#include "sckf_odometry/experiments/visual_odometry.h"

namespace sckf {
namespace {

TEST(StereoCamera, ProjectsByHand) {
  StereoCamera camera;
  camera.focal_length = 100.0;
  camera.baseline = 0.5;
  EXPECT_TRUE(matricesNear(camera.project({1.0, 2.0, 4.0}), Eigen::Vector3d(25.0, 50.0, 12.5), 1e-12));
  EXPECT_TRUE(camera.sees({1.0, 2.0, 4.0}));
  EXPECT_FALSE(camera.sees({1.0, 2.0, -4.0})) << "behind";
  EXPECT_FALSE(camera.sees({1.0, 2.0, 11.0})) << "too far";
  EXPECT_FALSE(camera.sees({0.0, 2.5, 1.0})) << "below the image";
}

TEST(StereoCamera, TriangulatesWhatItProjected) {
  const StereoCamera camera;
  RandomInputs random(131);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d point(random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(1, 10));
    const Eigen::Vector3d pixels = camera.project(point);
    Eigen::Matrix3d J;
    EXPECT_TRUE(matricesNear(camera.triangulate(pixels, &J), point, 1e-12));
    for (int j = 0; j < 3; ++j) {
      const Eigen::Vector3d e = 1e-4 * Eigen::Vector3d::Unit(j);
      Eigen::Matrix3d unused;
      const Eigen::Vector3d numerical =
          (camera.triangulate(pixels + e, &unused) - camera.triangulate(pixels - e, &unused)) / 2e-4;
      EXPECT_TRUE(matricesNear(J.col(j), numerical, 1e-6));
    }
  }
}

/// Two views of random features, without noise; some features only one of them has.
struct TwoViews {
  const StereoCamera camera;
  const SE3 moved{{0.1, -0.2, 1.0}, rotationExp({0.02, 0.05, -0.03})};
  StereoView reference, current;

  TwoViews() {
    RandomInputs random(132);
    for (int i = 0; i < 60; ++i) {
      const Eigen::Vector3d point(random.uniform(-4, 4), random.uniform(-3, 3), random.uniform(1.5, 9.0));
      const Eigen::Vector3d seen = between(moved, SE3{point, Eigen::Matrix3d::Identity()}).translation;
      if (camera.sees(point)) add(i, point, reference);
      if (camera.sees(seen)) add(i, seen, current);
    }
  }

  void add(int number, const Eigen::Vector3d& point, StereoView& view) const {
    view.features.push_back(number);
    view.pixels.push_back(camera.project(point));
  }

  StereoDisplacement match() const { return matchViews(camera, reference, current, 0.5, SE3()); }
};

TEST(MatchViews, FindsTheDisplacement) {
  const TwoViews views;
  const StereoDisplacement z = views.match();
  EXPECT_GT(z.shared, 10);
  EXPECT_TRUE(matricesNear(error(z.reference_from_current, views.moved), Vector6d::Zero(), 1e-9));
}

/// The derivative by every pixel coordinate of either view, zero for features that only one of them has.
TEST(MatchViews, HasItsJacobians) {
  constexpr double kStep = 1e-4;
  TwoViews views;
  const StereoDisplacement z = views.match();
  const auto check = [&views](StereoView& view, const Eigen::MatrixXd& J) {
    for (std::size_t i = 0; i < view.pixels.size(); ++i) {
      for (int j = 0; j < 3; ++j) {
        const auto column = static_cast<Eigen::Index>(3 * i) + j;
        view.pixels[i](j) += kStep;
        const SE3 plus = views.match().reference_from_current;
        view.pixels[i](j) -= 2.0 * kStep;
        const SE3 minus = views.match().reference_from_current;
        view.pixels[i](j) += kStep;
        EXPECT_TRUE(matricesNear(J.col(column), error(plus, minus) / (2.0 * kStep), 1e-7)) << column;
      }
    }
  };
  check(views.reference, z.measurement.J_reference);
  check(views.current, z.measurement.J_current);
}

TEST(VisualOdometry, IsMonotonicWithAndHasAValleyWithout) {
  VisualOdometryOptions options;
  options.runs = 2;
  const auto points = simulateVisualOdometry(options, {0.25, 0.5, 1.0, 2.0, 4.0}, [] {});
  for (std::size_t i = 1; i < points.size(); ++i) {
    EXPECT_GT(points[i].with_correlations.position, points[i - 1].with_correlations.position);
    EXPECT_GT(points[i].with_correlations.attitude, points[i - 1].with_correlations.attitude);
  }
  EXPECT_GT(points[0].without.position, 1.2 * points[2].without.position);
  EXPECT_GT(points[4].without.position, 1.2 * points[2].without.position);
  EXPECT_GT(points[0].without.attitude, 1.2 * points[2].without.attitude);
  EXPECT_GT(points[4].without.attitude, 1.2 * points[2].without.attitude);
}

}  // namespace
}  // namespace sckf
