#include "sckf_odometry/ros/health.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <sstream>

namespace sckf {

namespace {

using Status = diagnostic_msgs::DiagnosticStatus;
using StatusWrapper = diagnostic_updater::DiagnosticStatusWrapper;

/// A row of so many scans that did not correct the estimate, or of so many messages that were refused, is worth a
/// warning.
constexpr std::size_t kManyUnused = 10;

/// Messages come in lumps: a shorter silence is none [s].
constexpr double kShortestSilence = 0.5;

void addEnds(const std::string& kind, const MessageTally& tally, StatusWrapper& status) {
  for (const auto& [how, count] : tally.ends()) status.add(kind + ": " + how, count);
  std::size_t refused = 0;
  for (const auto& [how, count] : tally.ends()) refused += how.rfind("refused", 0) == 0 ? count : 0;
  status.add(kind + ": refused", refused);
  status.add(kind + ": together", tally.together());
}

void addRecent(const std::string& kind, const MessageTally::Recent& recent, StatusWrapper& status) {
  status.addf(kind + ": rate [1/s]", "%.1f", recent.rate);
  if (!recent.latency) return;
  status.addf(kind + ": latency, mean [s]", "%.3f", *recent.latency);
  status.addf(kind + ": latency, longest [s]", "%.3f", *recent.latency_max);
}

void warnOfRefusals(const std::string& what, const MessageTally& tally, std::vector<Health::Finding>& findings) {
  if (tally.refusedInARow() < kManyUnused) return;
  findings.push_back({Status::WARN, "refused " + what,
                      "none of the last " + std::to_string(tally.refusedInARow()) + " messages of " + what +
                          " was used; the last one: " + tally.lastRefusal()});
}

std::string silenceOf(const std::string& what, double silence, const std::string& parameter, double timeout) {
  std::ostringstream text;
  text.precision(3);
  text << "no " << what << " for " << silence << " s (~" << parameter << ": " << timeout << " s)";
  return text.str();
}

}  // namespace

Health::Health(const std::string& odometry_source, const std::vector<std::string>& scan_topics)
    : odometry_source_(odometry_source) {
  for (const std::string& topic : scan_topics) lasers_.push_back({topic, {}, LaserConstants()});
}

void Health::scanCame(std::size_t laser, const ros::Time& stamp, const ros::Time& now) {
  scans.came(stamp, now);
  lasers_[laser].tally.came(stamp, now);
}

void Health::scanRefused(std::size_t laser, const std::string& kind, const std::string& reason, std::size_t count) {
  scans.refused(kind, reason, count);
  lasers_[laser].tally.refused(kind, reason, count);
}

void Health::scanAdmitted(std::size_t laser) { lasers_[laser].tally.used(); }

std::string Health::topicNotHeard() const {
  for (const Laser& laser : lasers_) {
    if (!laser.tally.anyUsed()) return laser.topic;
  }
  return "";
}

void Health::scanTaken(const ScanReport& report) {
  if (scans_in_pipeline_ > 0) --scans_in_pipeline_;
  const bool is_failed_match = report.outcome == ScanOutcome::kNoMatch;
  scans.ended(toString(report.outcome) + (is_failed_match ? ", " + toString(report.match.failure) : ""));
  ++deskewing_[report.deskewing];
  last_scan_ = toString(report.outcome) + (report.reason.empty() ? "" : ": " + report.reason);
  slips_now_ = report.outcome == ScanOutcome::kSlip;
  if (slips_now_) ++slips_;
  unused_in_a_row_ = report.reason.empty() ? 0 : unused_in_a_row_ + 1;
  if (report.innovation) {
    last_dimension_ = report.innovation->residual.size();
    last_nis_ = report.innovation->nis();
  }
  if (!report.estimate) return;
  last_stamp_ = report.stamp;
  calibration_ = report.calibration;
  lasers_[report.laser].constants = report.laser_constants;
  gyro_bias_ = report.gyro_bias;
  stands_ = report.stands;
  if (report.heading == HeadingUse::kUsed) ++headings_used_;
  if (report.heading == HeadingUse::kContradicts) ++headings_contradicting_;
  if (report.new_reference) reference_stamp_ = report.stamp;
  ++timed_;
  time_ += report.total_time;
  time_max_ = std::max(time_max_, report.total_time);
}

void Health::poseUpdateTaken(const PoseReport& report) {
  if (poses_in_pipeline_ > 0) --poses_in_pipeline_;
  const bool used = report.outcome == PoseOutcome::kUsed || report.outcome == PoseOutcome::kEntered;
  used ? pose_updates.used(toString(report.outcome)) : pose_updates.ended(toString(report.outcome));
  poses_contradicting_ = report.outcome == PoseOutcome::kContradicts ? poses_contradicting_ + 1 : 0;
  last_pose_nis_ = report.nis;
}

void Health::pipelineDropped(const std::string& how, std::size_t odometry_jumps) {
  scans.ended(how, scans_in_pipeline_);
  scans_in_pipeline_ = 0;
  pose_updates.ended(how, poses_in_pipeline_);
  poses_in_pipeline_ = 0;
  reference_stamp_ = last_stamp_ = Stamp(0);
  odometry_jumps_before_ += odometry_jumps;
  unused_in_a_row_ = 0;
  slips_now_ = false;
}

std::vector<Health::Finding> Health::report(const Conditions& conditions, const Options& options, const ros::Time& now,
                                            StatusWrapper& status) {
  std::vector<Finding> findings = this->findings(conditions, options, now);
  status.summary(Status::OK, "");
  for (const Finding& finding : findings) {
    status.summary(std::max(static_cast<unsigned char>(status.level), finding.level),
                   status.message + (status.message.empty() ? "" : "; ") + finding.text);
  }
  if (findings.empty()) status.message = "estimating";
  status.add("paused", conditions.paused);
  addScans(conditions, now, status);
  addOdometry(conditions, now, status);
  if (options.pipeline.imu.isUsed()) addImu(conditions, now, status);
  if (options.pipeline.pose_updates.on) addPoseUpdates(now, status);
  addEstimate(conditions, status);
  slips_reported_ = slips_;
  headings_contradicting_reported_ = headings_contradicting_;
  odometry_jumps_reported_ = odometry_jumps_before_ + conditions.odometry_jumps;
  return findings;
}

std::vector<Health::Finding> Health::findings(const Conditions& conditions, const Options& options,
                                              const ros::Time& now) const {
  std::vector<Finding> findings;
  const auto warn = [&findings](const std::string& kind, const std::string& text) {
    findings.push_back({Status::WARN, kind, text});
  };
  const double odometry_timeout = options.pipeline.odometry_timeout;
  const double odometry_silence = odometry.silence(now).value_or(0.0);
  if (odometry_silence > odometry_timeout) {
    findings.push_back(
        {Status::ERROR, "odometry timeout",
         silenceOf("odometry on " + odometry_source_, odometry_silence, "odometry_timeout", odometry_timeout) +
             (options.pipeline.scans_alone ? ": the scans carry on alone" : ": the estimate waits")});
  }
  if (now.isZero()) warn("no time", "no time on /clock, and /use_sim_time is true");
  if (!conditions.second_parent.empty()) warn("second parent", conditions.second_parent);
  if (conditions.paused) {
    warn("paused", "paused");
    return findings;
  }
  if (!conditions.waiting_for.empty()) warn("waiting", "waiting for " + conditions.waiting_for);
  warnOfRefusals("odometry on " + odometry_source_, odometry, findings);
  const double scan_timeout = options.node.scan_timeout;
  const bool all_silent = scans.silence(now).value_or(0.0) > scan_timeout;
  for (const Laser& laser : lasers_) {
    warnOfRefusals("scans on " + laser.topic, laser.tally, findings);
    const double silence = laser.tally.silence(now).value_or(0.0);
    if (silence <= scan_timeout) continue;
    warn("scan timeout " + laser.topic,
         silenceOf("scans on " + laser.topic, silence, "scan_timeout", scan_timeout) +
             (all_silent ? ": the wheels carry on alone" : ": wheels and other lasers carry on"));
  }
  if (unused_in_a_row_ >= kManyUnused) {
    warn("scans unused", "the last " + std::to_string(unused_in_a_row_) +
                             " scans did not correct the estimate; the last one: " + last_scan_);
  }
  if (odometry_jumps_before_ + conditions.odometry_jumps > odometry_jumps_reported_) {
    warn("odometry jump", "the odometry on " + odometry_source_ + " jumped: not taken for motion");
  }
  findOtherSensors(options, now, findings);
  if (slips_ > slips_reported_) warn("slip", "the wheels slip: the scans are believed");
  return findings;
}

void Health::findOtherSensors(const Options& options, const ros::Time& now, std::vector<Finding>& findings) const {
  const auto warn = [&findings](const std::string& kind, const std::string& text) {
    findings.push_back({Status::WARN, kind, text});
  };
  warnOfRefusals("the IMU", imu, findings);
  const double imu_timeout = std::max(options.pipeline.imu.timeout, kShortestSilence);
  const double imu_silence = imu.silence(now).value_or(0.0);
  if (imu_silence > imu_timeout) {
    warn("imu timeout", silenceOf("IMU", imu_silence, "imu_timeout", options.pipeline.imu.timeout) +
                            ": the estimate goes on without it");
  }
  warnOfRefusals("absolute poses", pose_updates, findings);
  if (poses_contradicting_ > 0) {
    warn("pose updates", "the last " + std::to_string(poses_contradicting_) +
                             " absolute poses contradict the estimate in " + options.node.map_frame);
  }
  if (headings_contradicting_ > headings_contradicting_reported_) {
    warn("heading", "the orientation of the IMU contradicts the estimate: not used");
  }
}

void Health::addScans(const Conditions& conditions, const ros::Time& now, StatusWrapper& status) {
  status.add("scans: received", scans.received());
  addEnds("scans", scans, status);
  status.add("scans: waiting for odometry", scans_in_pipeline_);
  status.add("scans: waiting for their mount", conditions.scans_without_mount);
  status.add("scans: held back", conditions.scans_held_back);
  addRecent("scans", scans.recent(now), status);
  for (const auto& [deskewing, count] : deskewing_) {
    if (deskewing != Deskewing::kOff) status.add("scans " + toString(deskewing), count);
  }
  const auto add_constant = [&status](const std::string& key, const LaserConstant& constant) {
    if (constant.variance() == 0.0) return;
    status.addf(key, "%.4f +- %.4f", constant.value(), std::sqrt(constant.variance()));
  };
  for (const Laser& laser : lasers_) {
    add_constant("range offset on " + laser.topic + " [m]", laser.constants.range_offset);
    add_constant("sweep duration on " + laser.topic + " [s]", laser.constants.sweep_duration);
  }
  status.add("last scan", last_scan_);
  if (timed_ == 0) return;
  status.addf("time of a scan, mean [ms]", "%.3f", 1e3 * time_ / static_cast<double>(timed_));
  status.addf("time of a scan, longest [ms]", "%.3f", 1e3 * time_max_);
}

void Health::addOdometry(const Conditions& conditions, const ros::Time& now, StatusWrapper& status) {
  status.add("odometry: messages", odometry.received());
  addEnds("odometry", odometry, status);
  status.add("odometry: held back", conditions.odometry_held_back);
  addRecent("odometry", odometry.recent(now), status);
  status.add("odometry: jumps", odometry_jumps_before_ + conditions.odometry_jumps);
  status.add("scans alone", conditions.scans_alone);
  status.add("time jumps: back", jumps_back_);
  status.add("time jumps: ahead", jumps_ahead_);
}

void Health::addEstimate(const Conditions& conditions, StatusWrapper& status) const {
  status.add("wheels slip", slips_now_);
  status.add("wheel slips", slips_);
  status.add("stands", stands_);
  status.addf("NIS", "%.3f", last_nis_);
  status.add("observed dimension", last_dimension_);
  addCalibration(status);
  if (reference_stamp_ == Stamp(0)) return;
  status.addf("reference age [s]", "%.3f",
              seconds(std::max(last_stamp_, conditions.newest_odometry) - reference_stamp_));
}

void Health::addImu(const Conditions& conditions, const ros::Time& now, StatusWrapper& status) {
  status.add("imu: messages", imu.received());
  addEnds("imu", imu, status);
  status.add("imu: held back", conditions.imu_held_back);
  addRecent("imu", imu.recent(now), status);
  status.addf("gyro bias [rad/s]", "%.5f +- %.5f", gyro_bias_.value, std::sqrt(gyro_bias_.variance));
  status.add("headings: used", headings_used_);
  status.add("headings: contradicting", headings_contradicting_);
}

void Health::addPoseUpdates(const ros::Time& now, StatusWrapper& status) {
  status.add("pose updates: messages", pose_updates.received());
  addEnds("pose updates", pose_updates, status);
  status.add("pose updates: waiting", poses_in_pipeline_);
  addRecent("pose updates", pose_updates.recent(now), status);
  status.addf("pose updates: NIS", "%.3f", last_pose_nis_);
}

void Health::addCalibration(StatusWrapper& status) const {
  const WheelCalibration::Vector std = calibration_.covariance.diagonal().cwiseSqrt();
  const char* const of[] = {"way [1]",         "rotation [1]",  "rotation per meter [rad/m]",
                            "laser ahead [m]", "floor x [m/m]", "floor y [m/m]"};
  for (Eigen::Index i = 0; i < WheelCalibration::kErrors; ++i) {
    if (std(i) == 0.0) continue;
    status.addf(std::string("error of the wheels: ") + of[i], "%.4f +- %.4f", calibration_.error(i), std(i));
  }
}

}  // namespace sckf
