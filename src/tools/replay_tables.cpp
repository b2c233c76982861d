#include "sckf_odometry/tools/replay_tables.h"

#include <Eigen/LU>
#include <cmath>
#include <string>

namespace sckf {

namespace {

void writePose(OutputFile& file, const SE2& pose) { file.print(",%.9f,%.9f,%.9f", pose.x, pose.y, pose.yaw); }

void writeCovariance(OutputFile& file, const Eigen::Matrix3d& P) {
  file.print(",%.9g,%.9g,%.9g,%.9g,%.9g,%.9g", P(0, 0), P(0, 1), P(0, 2), P(1, 1), P(1, 2), P(2, 2));
}

void writeEmpty(OutputFile& file, Eigen::Index columns) {
  for (Eigen::Index i = 0; i < columns; ++i) file.print(",");
}

/// The innovation by x, y, yaw, each divided by its std; only where all of them are seen.
void writeNormalised(OutputFile& file, const Displacement& z, const Innovation& innovation) {
  if (z.dimension() < 3) return writeEmpty(file, 3);
  const Eigen::Matrix3d by_pose = Eigen::Matrix3d(z.observable).inverse();
  const Eigen::Vector3d r = by_pose * innovation.residual;
  const Eigen::Vector3d variance = (by_pose * innovation.covariance * by_pose.transpose()).diagonal();
  for (Eigen::Index i = 0; i < 3; ++i) file.print(",%.9g", r(i) / std::sqrt(variance(i)));
}

/// Its covariance by x, y, yaw only where all of them are seen.
void writeDisplacement(OutputFile& file, const ScanReport& report) {
  const Displacement& z = *report.match.displacement;
  file.print(",%s", decimal(report.reference_stamp).c_str());
  writePose(file, report.prediction.reference_from_current);
  writePose(file, z.reference_from_current);
  file.print(",%d", static_cast<int>(z.dimension()));
  if (z.dimension() == 3) {
    const Eigen::Matrix3d by_pose = Eigen::Matrix3d(z.observable).inverse();
    writeCovariance(file, by_pose * z.covariance() * by_pose.transpose());
  } else {
    writeEmpty(file, 6);
  }
  for (Eigen::Index i = 0; i < z.dimension(); ++i) file.print(",%.9g", report.innovation->residual(i));
  writeEmpty(file, 3 - z.dimension());
  file.print(",%.9g", report.innovation->nis());
  writeNormalised(file, z, *report.innovation);
}

}  // namespace

std::string decimal(Stamp stamp) {
  char text[32];
  std::snprintf(text, sizeof(text), "%lld.%09lld", static_cast<long long>(stamp.count() / 1000000000),
                static_cast<long long>(stamp.count() % 1000000000));
  return text;
}

void writeTumLine(OutputFile& file, Stamp stamp, const SE2& pose) {
  file.print("%s %.9f %.9f 0 0 0 %.12f %.12f\n", decimal(stamp).c_str(), pose.x, pose.y, std::sin(0.5 * pose.yaw),
             std::cos(0.5 * pose.yaw));
}

void writeCsvHeader(OutputFile& file) {
  file.print(
      "stamp,x,y,yaw,var_x,cov_xy,cov_xyaw,var_y,cov_yyaw,var_yaw,"
      "reference_stamp,predicted_x,predicted_y,predicted_yaw,displacement_x,displacement_y,displacement_yaw,dimension,"
      "displacement_var_x,displacement_cov_xy,displacement_cov_xyaw,displacement_var_y,displacement_cov_yyaw,"
      "displacement_var_yaw,innovation_1,innovation_2,innovation_3,nis,"
      "normalised_x,normalised_y,normalised_yaw,pairs,overlap,agreement,misfit,new_reference,outcome,reason\n");
}

void writeCsvLine(OutputFile& file, const ScanReport& report) {
  file.print("%s", decimal(report.stamp).c_str());
  if (report.estimate) {
    writePose(file, report.estimate->odom_from_base);
    writeCovariance(file, report.estimate->covariance);
  } else {
    writeEmpty(file, 9);
  }
  if (report.innovation) {
    writeDisplacement(file, report);
  } else {
    writeEmpty(file, 21);
  }
  file.print(",%zu,%.6f,%.6f,%.6f,%d,%s,\"%s\"\n", report.match.pairs.size(), report.match.overlap,
             report.match.agreement, report.match.misfit, report.new_reference ? 1 : 0,
             toString(report.outcome).c_str(), report.reason.c_str());
}

}  // namespace sckf
