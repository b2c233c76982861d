#include "sckf_odometry/pipeline/scan_odometry.h"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <sstream>
#include <stdexcept>

namespace sckf {

namespace {

Stamp fromSeconds(double s) { return std::chrono::duration_cast<Stamp>(std::chrono::duration<double>(s)); }

/// The value that a χ² variable of so many degrees of freedom exceeds with probability 1 − p.
double chiSquared(Eigen::Index degrees_of_freedom, double p) {
  return boost::math::quantile(boost::math::chi_squared(static_cast<double>(degrees_of_freedom)), p);
}

ScanReport notUsed(Stamp stamp, ScanOutcome outcome, const std::string& reason) {
  ScanReport report;
  report.stamp = stamp;
  report.outcome = outcome;
  report.reason = reason;
  return report;
}

std::string describe(const Innovation& innovation, double bound) {
  std::ostringstream text;
  text << "normalised innovation squared " << innovation.nis() << " exceeds " << bound << " ("
       << innovation.residual.size() << " degrees of freedom)";
  return text.str();
}

}  // namespace

std::string toString(ScanOutcome outcome) {
  switch (outcome) {
    case ScanOutcome::kReference:
      return "reference";
    case ScanOutcome::kUpdated:
      return "updated";
    case ScanOutcome::kSlip:
      return "slip";
    case ScanOutcome::kGated:
      return "gated";
    case ScanOutcome::kNoMatch:
      return "no match";
    case ScanOutcome::kUnusable:
      return "unusable";
    case ScanOutcome::kOutOfOrder:
      return "out of order";
    case ScanOutcome::kNoOdometry:
      return "no odometry";
  }
  return "unknown";
}

ScanOdometry::ScanOdometry(const PipelineOptions& options)
    : options_(options), matcher_(options.matcher), reference_policy_(options.reference), twist_(options.twist_window) {
  if (!makeFusionMethod(options.method, SE2(), Eigen::Matrix3d::Zero())) {
    std::string known;
    for (const std::string& name : fusionMethodNames()) known += (known.empty() ? "" : ", ") + name;
    throw std::invalid_argument("method is \"" + options.method + "\": expected one of " + known);
  }
}

OdometryBuffer::Insertion ScanOdometry::addOdometry(const OdometrySample& sample) {
  std::optional<OdometrySample> before;
  if (!odometry_.empty()) before = odometry_.newestSample();
  const OdometryBuffer::Insertion insertion = odometry_.insert(sample);
  if (insertion != OdometryBuffer::Insertion::kInserted) return insertion;
  if (before && sample.stamp > before->stamp) {
    twist_.add(increment({*before, sample}), seconds(sample.stamp - before->stamp));
  }
  if (!filter_) start(sample);
  // Without scans the filter follows the wheels at a distance, so that the buffer stays small; from sample to sample,
  // so that it makes no difference when the samples arrived.
  const Stamp too_old = odometry_.newest() - fromSeconds(options_.max_scan_delay);
  if (too_old > filter_stamp_) {
    const Stamp last = odometry_.lastUpTo(too_old);
    if (last > filter_stamp_) propagateTo(last);
  }
  carryOn();
  return insertion;
}

void ScanOdometry::addScan(LaserScan scan, const Eigen::Isometry3d& base_from_laser) {
  const auto later = [](Stamp stamp, const WaitingScan& other) { return stamp < other.scan.stamp; };
  const auto place = std::upper_bound(waiting_.begin(), waiting_.end(), scan.stamp, later);
  waiting_.insert(place, {std::move(scan), base_from_laser});
  if (waiting_.size() > static_cast<std::size_t>(options_.max_waiting_scans)) {
    given_up_.push_back(notUsed(waiting_.front().scan.stamp, ScanOutcome::kNoOdometry,
                                "too many scans wait for odometry at their stamps"));
    waiting_.pop_front();
  }
}

std::vector<ScanReport> ScanOdometry::process() {
  std::vector<ScanReport> reports;
  reports.swap(given_up_);
  while (!waiting_.empty() && filter_ && waiting_.front().scan.stamp <= odometry_.newest()) {
    reports.push_back(take(waiting_.front()));
    waiting_.pop_front();
  }
  return reports;
}

ScanReport ScanOdometry::take(const WaitingScan& waiting) {
  const Stamp stamp = waiting.scan.stamp;
  if (!odometry_.covers(stamp)) return notUsed(stamp, ScanOutcome::kNoOdometry, "older than the odometry at hand");
  if (stamp < filter_stamp_ || (reference_ && stamp == filter_stamp_)) {
    return notUsed(stamp, ScanOutcome::kOutOfOrder, "not newer than the estimate");
  }
  ScanReport report;
  report.stamp = stamp;
  propagateTo(stamp);  // (9)-(14)
  report.scan = prepareScan(waiting.scan, waiting.base_from_laser, options_.scan, &report.reason);
  if (!report.scan) {
    report.outcome = ScanOutcome::kUnusable;
  } else if (!reference_) {
    report.new_reference = true;
  } else {
    compareWithReference(report);  // (16)-(23)
  }
  if (report.new_reference) {
    filter_->clone(report.scan->rangeVariances());  // (24)-(27)
    reference_ = report.scan;
  }
  report.estimate = estimate();
  carried_on_.reset();
  carryOn();
  return report;
}

void ScanOdometry::compareWithReference(ScanReport& report) {
  report.reference_stamp = reference_->stamp;
  report.prediction = filter_->predictedDisplacement();                         // (16)
  report.match = matcher_.match(*reference_, *report.scan, report.prediction);  // (1)
  const bool used = report.match.displacement ? fuse(report) : false;           // (17)-(23)
  if (!report.match.displacement) {
    report.outcome = ScanOutcome::kNoMatch;
    report.reason = toString(report.match.failure);
  }
  const SE2 reference_from_scan = filter_->predictedDisplacement().reference_from_current;
  report.new_reference = reference_policy_.replaces(reference_from_scan, report.match.overlap, used);
}

bool ScanOdometry::fuse(ScanReport& report) {
  const Displacement& displacement = *report.match.displacement;
  const double bound = chiSquared(displacement.dimension(), options_.gate.probability);
  report.innovation = filter_->innovation(displacement);
  report.outcome = ScanOutcome::kUpdated;
  if (report.innovation->nis() > bound && looksLikeSlip(report.match)) {
    const Eigen::Vector3d std(options_.gate.slip_std_translation, options_.gate.slip_std_translation,
                              options_.gate.slip_std_yaw);
    filter_->distrustWheels(std.cwiseAbs2().asDiagonal());
    report.innovation = filter_->innovation(displacement);
    report.outcome = ScanOutcome::kSlip;
  }
  if (report.innovation->nis() > bound) {
    report.outcome = ScanOutcome::kGated;
    report.reason = describe(*report.innovation, bound);
    return false;
  }
  filter_->update(displacement, *report.innovation);
  return true;
}

bool ScanOdometry::looksLikeSlip(const Match& match) const {
  return options_.gate.trust_scans_on_slip && match.displacement->dimension() == 3 &&
         match.overlap >= options_.gate.slip_min_overlap && match.residual_rms <= options_.gate.slip_max_residual;
}

std::optional<Estimate> ScanOdometry::latest() const {
  if (!carried_on_) return std::nullopt;
  return Estimate{carried_on_stamp_, carried_on_->pose(), carried_on_->covariance(), twist_.twist()};
}

void ScanOdometry::start(const OdometrySample& first) {
  filter_ = makeFusionMethod(options_.method, SE2(), Eigen::Matrix3d::Zero());  // (6)(7)
  filter_stamp_ = first.stamp;
}

void ScanOdometry::propagateTo(Stamp stamp) {
  for (const OdometryBuffer::Step& step : odometry_.steps(filter_stamp_, stamp)) filter_->propagate(increment(step));
  filter_stamp_ = stamp;
  odometry_.discardBefore(stamp);
}

void ScanOdometry::carryOn() {
  if (!carried_on_) {
    carried_on_.emplace(filter_->pose(), filter_->covariance());
    carried_on_stamp_ = filter_stamp_;
  }
  for (const OdometryBuffer::Step& step : odometry_.steps(carried_on_stamp_, odometry_.newest())) {
    carried_on_->propagate(increment(step));
  }
  carried_on_stamp_ = odometry_.newest();
}

OdometryIncrement ScanOdometry::increment(const OdometryBuffer::Step& step) const {
  const SE2 motion = between(step.from.odom_from_base, step.to.odom_from_base);
  const auto& stated = step.to.twist_covariance;
  if (options_.prefer_twist_covariance && stated && sensibleTwistCovariance(*stated)) {
    return statedIncrement(motion, *stated, seconds(step.to.stamp - step.from.stamp));
  }
  return modelledIncrement(motion, options_.odometry_noise);
}

Estimate ScanOdometry::estimate() const {
  return {filter_stamp_, filter_->pose(), filter_->covariance(), twist_.twist()};
}

}  // namespace sckf
