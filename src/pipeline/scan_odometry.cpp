#include "sckf_odometry/pipeline/scan_odometry.h"

#include <boost/math/distributions/chi_squared.hpp>
#include <stdexcept>

namespace sckf {

std::string toString(ScanOutcome outcome) {
  switch (outcome) {
    case ScanOutcome::kReference:
      return "reference";
    case ScanOutcome::kUpdated:
      return "updated";
    case ScanOutcome::kNoMatch:
      return "no match";
    case ScanOutcome::kGated:
      return "gated";
    case ScanOutcome::kSlip:
      return "slip";
    case ScanOutcome::kNoOdometry:
      return "no odometry";
    case ScanOutcome::kOutOfOrder:
      return "out of order";
    case ScanOutcome::kUnusable:
      return "unusable";
  }
  return "unknown";
}

ScanOdometry::ScanOdometry(const PipelineOptions& options) : options_(options), matcher_(options.matcher) {}
ScanOdometry::~ScanOdometry() = default;

OdometryBuffer::Insertion ScanOdometry::addOdometry(const OdometrySample& sample) { return odometry_.insert(sample); }

void ScanOdometry::addScan(const LaserScan& scan, const Eigen::Isometry3d& base_from_laser) {
  const auto later = [](const WaitingScan& a, const WaitingScan& b) { return a.scan.stamp < b.scan.stamp; };
  WaitingScan waiting{scan, base_from_laser};
  waiting_.insert(std::upper_bound(waiting_.begin(), waiting_.end(), waiting, later), waiting);
}

std::vector<ScanReport> ScanOdometry::process() {
  std::vector<ScanReport> reports;
  while (!waiting_.empty() && !odometry_.empty() && waiting_.front().scan.stamp <= odometry_.newest()) {
    reports.push_back(processScan(waiting_.front()));
    waiting_.pop_front();
  }
  return reports;
}

ScanReport ScanOdometry::processScan(const WaitingScan& waiting) {
  ScanReport report;
  report.estimate.stamp = waiting.scan.stamp;
  std::string rejection;
  if (!odometry_.covers(waiting.scan.stamp)) {
    report.outcome = ScanOutcome::kNoOdometry;
    return report;
  }
  const auto scan = prepareScan(waiting.scan, waiting.base_from_laser, options_.scan, &rejection);
  report.scan = scan;
  if (!filter_) {
    filter_ = makeFusionMethod(options_.method, SE2(), Eigen::Matrix3d::Zero());
    filter_stamp_ = waiting.scan.stamp;
  }
  for (const auto& step : odometry_.steps(filter_stamp_, waiting.scan.stamp)) {
    filter_->propagate(
        modelledIncrement(between(step.from.odom_from_base, step.to.odom_from_base), options_.odometry_noise));
  }
  filter_stamp_ = waiting.scan.stamp;
  odometry_.discardBefore(filter_stamp_);
  report.estimate.odom_from_base = filter_->pose();
  report.estimate.covariance = filter_->covariance();
  if (!scan) {
    report.outcome = ScanOutcome::kUnusable;
    report.reason = rejection;
    return report;
  }
  if (!reference_) {
    reference_ = scan;
    filter_->clone(scan->rangeVariances());
    report.new_reference = true;
    return report;
  }
  report.reference_stamp = reference_->stamp;
  report.prediction = filter_->predictedDisplacement();
  report.match = matcher_.match(*reference_, *scan, report.prediction);
  if (!report.match.displacement) {
    report.outcome = ScanOutcome::kNoMatch;
    report.reason = toString(report.match.failure);
  } else {
    const auto& z = *report.match.displacement;
    report.innovation = filter_->innovation(z);
    const double bound =
        boost::math::quantile(boost::math::chi_squared(static_cast<double>(z.dimension())), options_.gate_probability);
    report.outcome = ScanOutcome::kUpdated;
    if (report.innovation->nis() > bound) {
      report.outcome = ScanOutcome::kGated;
      if (options_.slip) {
        Eigen::Matrix3d Q = Eigen::Vector3d(0.3, 0.3, 0.3).cwiseAbs2().asDiagonal();
        filter_->propagate({SE2(), Q});
        report.innovation = filter_->innovation(z);
        report.outcome = ScanOutcome::kSlip;
      }
    }
    if (report.outcome != ScanOutcome::kGated) filter_->update(z, *report.innovation);
  }
  const SE2 moved = filter_->predictedDisplacement().reference_from_current;
  const double way = moved.translation().norm() + (moved.translation() - last_.translation()).norm();
  const double turn = std::abs(moved.yaw) + std::abs(wrapAngle(moved.yaw - last_.yaw));
  last_ = moved;
  if (!report.match.displacement || way > options_.kf_dist_linear || turn > options_.kf_dist_angular ||
      report.match.overlap < options_.kf_min_overlap) {
    filter_->clone(scan->rangeVariances());
    reference_ = scan;
    last_ = SE2();
    report.new_reference = true;
  }
  report.estimate.odom_from_base = filter_->pose();
  report.estimate.covariance = filter_->covariance();
  return report;
}

std::optional<Estimate> ScanOdometry::latest() const { return std::nullopt; }

}  // namespace sckf
