// Whether it is well with the estimate, and what has become of every message: for the diagnostics.
#pragma once

#include <diagnostic_updater/DiagnosticStatusWrapper.h>

#include <map>
#include <string>
#include <vector>

#include "sckf_odometry/pipeline/scan_odometry.h"
#include "sckf_odometry/ros/message_tally.h"
#include "sckf_odometry/ros/parameters.h"

namespace sckf {

class Health {
 public:
  /// What only the node knows, at the time of a report.
  struct Conditions {
    std::string waiting_for;    ///< empty if for nothing
    std::string second_parent;  ///< who else publishes the transform of the estimate, and what to do; empty if nobody
    bool paused = false;
    bool scans_alone = false;            ///< wheels are silent, and scans carry on
    std::size_t odometry_jumps = 0;      ///< steps of the wheels that were not taken for motion
    std::size_t odometry_held_back = 0;  ///< until the next stamps tell whether time has jumped
    std::size_t scans_held_back = 0;
    std::size_t scans_without_mount = 0;  ///< that wait for the transform to their laser
    std::size_t imu_held_back = 0;
    Stamp newest_odometry{0};  ///< stamp
  };

  /// What is not as it should be.
  struct Finding {
    unsigned char level;  ///< of diagnostic_msgs/DiagnosticStatus
    std::string kind;
    std::string text;
  };

  /// scan_topics: one for each laser.
  Health(const std::string& odometry_source, const std::vector<std::string>& scan_topics);

  MessageTally odometry;
  MessageTally scans;         ///< of all lasers
  MessageTally imu;           ///< if it is used
  MessageTally pose_updates;  ///< if they are used

  void scanCame(std::size_t laser, const ros::Time& stamp, const ros::Time& now);
  void scanRefused(std::size_t laser, const std::string& kind, const std::string& reason, std::size_t count = 1);
  /// Nothing is wrong with it by itself, nor with its stamp.
  void scanAdmitted(std::size_t laser);
  /// The topic of a laser of which no scan that could be used has come; empty if there is none.
  std::string topicNotHeard() const;

  /// The scan went to the pipeline, and will be reported, unless the pipeline is dropped before.
  void scanPassed() { ++scans_in_pipeline_; }
  void scanTaken(const ScanReport& report);
  void poseUpdateTaken(const PoseReport& report);
  void poseUpdatePassed() { ++poses_in_pipeline_; }
  void pipelineDropped(const std::string& how, std::size_t odometry_jumps);

  void timeJumped(double by) { ++(by < 0.0 ? jumps_back_ : jumps_ahead_); }

  /// ERROR: the wheels are silent for longer than the time-out. WARN: what the estimate lacks, or what casts doubt on
  /// it since the last report. Adds counts and measures to the status.
  std::vector<Finding> report(const Conditions& conditions, const Options& options, const ros::Time& now,
                              diagnostic_updater::DiagnosticStatusWrapper& status);

 private:
  std::vector<Finding> findings(const Conditions& conditions, const Options& options, const ros::Time& now) const;
  void findOtherSensors(const Options& options, const ros::Time& now, std::vector<Finding>& findings) const;
  void addScans(const Conditions& conditions, const ros::Time& now,
                diagnostic_updater::DiagnosticStatusWrapper& status);
  void addOdometry(const Conditions& conditions, const ros::Time& now,
                   diagnostic_updater::DiagnosticStatusWrapper& status);
  void addEstimate(const Conditions& conditions, diagnostic_updater::DiagnosticStatusWrapper& status) const;
  void addImu(const Conditions& conditions, const ros::Time& now, diagnostic_updater::DiagnosticStatusWrapper& status);
  void addPoseUpdates(const ros::Time& now, diagnostic_updater::DiagnosticStatusWrapper& status);
  void addCalibration(diagnostic_updater::DiagnosticStatusWrapper& status) const;

  std::string odometry_source_;
  struct Laser {
    std::string topic;
    MessageTally tally;        // how they ended: only as far as they were admitted or refused
    LaserConstants constants;  // variance zero: not estimated
  };
  std::vector<Laser> lasers_;
  std::size_t scans_in_pipeline_ = 0;
  std::size_t poses_in_pipeline_ = 0;
  std::size_t poses_contradicting_ = 0;  // in a row
  double last_pose_nis_ = 0.0;
  std::size_t jumps_back_ = 0;
  std::size_t jumps_ahead_ = 0;

  std::map<Deskewing, std::size_t> deskewing_;  // of the scans
  std::string last_scan_;                       // what became of it
  bool slips_now_ = false;
  Eigen::Index last_dimension_ = 0;
  double last_nis_ = 0.0;
  Stamp reference_stamp_{0};
  Stamp last_stamp_{0};
  GyroBias gyro_bias_;
  std::size_t headings_used_ = 0;
  std::size_t headings_contradicting_ = 0;
  std::size_t headings_contradicting_reported_ = 0;
  bool stands_ = false;
  WheelCalibration calibration_;  // covariance zero: not estimated
  std::size_t slips_ = 0;
  std::size_t slips_reported_ = 0;
  std::size_t odometry_jumps_before_ = 0;  // of pipelines that were dropped
  std::size_t odometry_jumps_reported_ = 0;
  std::size_t unused_in_a_row_ = 0;  // scans that did not correct the estimate
  std::size_t timed_ = 0;            // scans that took time
  double time_ = 0.0;                // [s], of those together
  double time_max_ = 0.0;            // [s]
};

}  // namespace sckf
