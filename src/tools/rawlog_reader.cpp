#include "sckf_odometry/tools/rawlog_reader.h"

#include <mrpt/io/CFileGZInputStream.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CObservationComment.h>
#include <mrpt/obs/CRawlog.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/serialization/CArchive.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

namespace sckf {
namespace {

using mrpt::obs::CActionCollection;
using mrpt::obs::CActionRobotMovement2D;
using mrpt::obs::CObservation2DRangeScan;
using mrpt::obs::CSensoryFrame;

/// Rounded to microseconds: MRPT hands out doubles, and its ground truth has six decimals.
std::optional<ros::Time> toRosTime(const mrpt::system::TTimeStamp& stamp) {
  if (stamp == INVALID_TIMESTAMP) return std::nullopt;
  const double seconds = mrpt::Clock::toDouble(stamp);
  if (!(seconds > 0.0 && seconds < std::numeric_limits<uint32_t>::max())) return std::nullopt;
  const auto microseconds = static_cast<uint64_t>(std::llround(seconds * 1e6));
  return ros::Time(static_cast<uint32_t>(microseconds / 1000000), static_cast<uint32_t>(microseconds % 1000000 * 1000));
}

/// What the wheels measured; without a raw reading the mean of the estimated change of pose.
std::optional<SE2> odometryIncrement(CActionCollection& actions) {
  auto movement = actions.getMovementEstimationByType(CActionRobotMovement2D::emOdometry);
  const bool has_raw_reading = movement != nullptr;
  if (!has_raw_reading) movement = actions.getBestMovementEstimation();
  if (!movement) return std::nullopt;
  const mrpt::poses::CPose2D increment =
      has_raw_reading ? movement->rawOdometryIncrementReading : movement->poseChange->getMeanVal();
  return SE2(increment.x(), increment.y(), increment.phi());
}

/// The scan of the wanted laser in the frame, if it has one; the first laser found is the wanted one unless named.
CObservation2DRangeScan::Ptr pickScan(const CSensoryFrame& frame, std::optional<std::string>& label, Rawlog& log) {
  CObservation2DRangeScan::Ptr picked;
  for (size_t i = 0; i < frame.size(); ++i) {
    const auto scan = std::dynamic_pointer_cast<CObservation2DRangeScan>(frame.getObservationByIndex(i));
    if (!scan) continue;
    if (!label) label = scan->sensorLabel;
    if (picked || scan->sensorLabel != *label) {
      ++log.other_scans;
    } else {
      picked = scan;
    }
  }
  return picked;
}

/// Reads entry by entry, because MRPT's own loader takes a damaged file for one that ends there.
template <typename Visitor>
void forEachEntry(const std::string& path, Visitor visit) {
  if (std::filesystem::is_directory(path)) throw RawlogError(path + ": expected a rawlog: it is a folder");
  if (!std::filesystem::is_regular_file(path)) throw RawlogError(path + ": no such file");
  mrpt::io::CFileGZInputStream file;
  if (!file.open(path)) throw RawlogError(path + ": cannot be opened");
  auto archive = mrpt::serialization::archiveFrom(file);
  for (size_t entry = 0;; ++entry) {
    mrpt::serialization::CSerializable::Ptr object;
    try {
      object = archive.ReadObject();
    } catch (const mrpt::serialization::CExceptionEOF&) {
      return;
    } catch (const std::exception&) {
      throw RawlogError(entry == 0 ? path + ": not an MRPT rawlog, or one of a class unknown here"
                                   : path + ": entry " + std::to_string(entry) + " is damaged, or cut off");
    }
    visit(object, path + ": entry " + std::to_string(entry));
  }
}

class LogReader {
 public:
  explicit LogReader(const std::string& sensor_label) {
    if (!sensor_label.empty()) label_ = sensor_label;
  }

  void visit(const mrpt::serialization::CSerializable::Ptr& object, const std::string& where) {
    if (const auto actions = std::dynamic_pointer_cast<CActionCollection>(object)) {
      takeActions(*actions);
    } else if (const auto frame = std::dynamic_pointer_cast<CSensoryFrame>(object)) {
      takeFrame(*frame, where);
    } else if (const auto whole = std::dynamic_pointer_cast<mrpt::obs::CRawlog>(object)) {
      for (size_t i = 0; i < whole->size(); ++i) visit(whole->getAsGeneric(i), where);
    } else if (std::dynamic_pointer_cast<mrpt::obs::CObservation>(object) &&
               !std::dynamic_pointer_cast<mrpt::obs::CObservationComment>(object)) {
      throw RawlogError(where + " is a bare observation: only rawlogs of actions and sensory frames are supported");
    }
  }

  Rawlog take() { return std::move(log_); }

 private:
  void takeActions(CActionCollection& actions) {
    if (const auto increment = odometryIncrement(actions)) {
      odom_from_base_ = compose(odom_from_base_, *increment);
      ++log_.movements;
    }
  }

  void takeFrame(const CSensoryFrame& frame, const std::string& where) {
    const auto scan = pickScan(frame, label_, log_);
    if (!scan) return;
    if (log_.records.empty()) odom_from_base_ = SE2();
    if (!log_.records.empty() && !(scan->sensorPose == log_.records.front().scan->sensorPose)) {
      throw RawlogError(where + ": the laser's pose on the robot changes, which a static transform cannot say");
    }
    log_.records.push_back({scan, odom_from_base_, toRosTime(scan->timestamp), ros::Time()});
  }

  std::optional<std::string> label_;
  SE2 odom_from_base_;
  Rawlog log_;
};

/// See readRawlog(). Returns whether the stamps are the log's own.
bool assignStamps(std::vector<RawlogRecord>& records, double period) {
  bool usable = true;
  for (size_t i = 0; i < records.size(); ++i) {
    usable = usable && records[i].log_stamp && (i == 0 || *records[i].log_stamp > *records[i - 1].log_stamp);
  }
  const auto valid =
      std::find_if(records.begin(), records.end(), [](const RawlogRecord& r) { return r.log_stamp.has_value(); });
  const ros::Time start = valid == records.end() ? ros::Time(1, 0) : *valid->log_stamp;
  for (size_t i = 0; i < records.size(); ++i) {
    records[i].stamp = usable ? *records[i].log_stamp : start + ros::Duration(period * static_cast<double>(i));
  }
  return usable;
}

}  // namespace

Rawlog readRawlog(const std::string& path, const std::string& sensor_label, double period) {
  LogReader reader(sensor_label);
  forEachEntry(path, [&](const auto& object, const auto& where) { reader.visit(object, where); });
  Rawlog log = reader.take();
  if (log.records.empty()) {
    throw RawlogError(path + ": no 2D laser scans" +
                      (sensor_label.empty() ? "" : " with the label '" + sensor_label + "'"));
  }
  if (log.movements == 0) throw RawlogError(path + ": no odometry");
  log.own_stamps = assignStamps(log.records, period);
  return log;
}

}  // namespace sckf
