#include <cmath>
#include <utility>
#include <vector>

#include "sckf_odometry/experiments/complexity.h"
#include "sckf_odometry/experiments/csv_file.h"
#include "sckf_odometry/tools/experiment_arguments.h"
#include "sckf_odometry/tools/progress_bar.h"

namespace sckf {

namespace {

void deskewing(const Arguments& arguments) {
  const std::vector<double> yaw_rates{0.0, 0.5, 1.0, 1.5, 2.0};
  ProgressBar progress(yaw_rates.size());
  const auto points = simulateDeskewing(arguments.deskewing, yaw_rates, [&progress] { progress.advance(); });
  progress.finish();
  CsvFile table(arguments.file("deskewing"),
                "yaw_rate,sweep,with_position,with_yaw,estimated_position,estimated_yaw,without_position,without_yaw");
  for (const DeskewingPoint& p : points) {
    table.row({p.yaw_rate, arguments.deskewing.sweep, p.with.position, p.with.yaw, p.estimated.position,
               p.estimated.yaw, p.without.position, p.without.yaw});
  }
}

void cloudInput(const Arguments& arguments) {
  const std::vector<int> beams{90, 180, 360, 720, 1440};
  ProgressBar progress(beams.size() + 2);
  const auto rows = simulateCloudInput(arguments.cloud_input, beams, [&progress] { progress.advance(); });
  progress.finish();
  CsvFile table(arguments.file("cloud_input"), "input,beams,position,yaw,scans,used");
  for (const CloudInputRow& row : rows) {
    table.row(row.input, {static_cast<double>(row.beams), row.errors.position, row.errors.yaw,
                          static_cast<double>(row.errors.scans), static_cast<double>(row.errors.used)});
  }
}

void odometryModels(const Arguments& arguments) {
  ProgressBar progress(odometryModelNames().size() * odometryModelNames().size());
  const auto rows = simulateOdometryModels(arguments.odometry_models, [&progress] { progress.advance(); });
  progress.finish();
  CsvFile table(arguments.file("odometry_models"), "robot,model,nees,largest_std,smallest_std,runs");
  for (const OdometryModelsRow& row : rows) {
    table.row(row.robot + "," + row.model,
              {row.nees, row.largest_std, row.smallest_std, static_cast<double>(arguments.odometry_models.runs)});
  }
}

void severalLasers(const Arguments& arguments) {
  const std::map<std::string, std::vector<SimulatedLaserRate>> robots{
      {"fast", {fastLaser()}}, {"slow", {slowLaser()}}, {"both", {fastLaser(), slowLaser()}}};
  ProgressBar progress(robots.size() + 3);
  const auto tick = [&progress] { progress.advance(); };
  CsvFile table(arguments.file("several_lasers"), "lasers,time,position,nees,runs");
  for (const auto& [name, lasers] : robots) {
    const SeveralLasersStatistics s = simulateSeveralLasers(lasers, arguments.several_lasers);
    for (std::size_t i = 0; i < s.nees.size(); ++i) {
      table.row(name, {0.025 * static_cast<double>(i), std::sqrt(s.squared_error[i]), s.nees[i],
                       static_cast<double>(arguments.several_lasers.runs)});
    }
    tick();
  }
  CsvFile mounted(arguments.file("mounted_lasers"), "lasers,position,yaw,scans,used");
  for (const MountedLasersRow& row : simulateMountedLasers(arguments.mounted_lasers, tick)) {
    mounted.row(row.lasers, {row.errors.position, row.errors.yaw, static_cast<double>(row.errors.scans),
                             static_cast<double>(row.errors.used)});
  }
  progress.finish();
}

/// Robots with sensors of some kinds, each kind with a name.
using Robots = std::vector<std::pair<std::string, SimulatedSensors>>;

void otherMeasurements(const Arguments& arguments, const std::string& experiment, const Robots& robots, int scans) {
  OtherMeasurementsOptions options = arguments.other_measurements;
  options.scans = scans;
  ProgressBar progress(robots.size());
  CsvFile table(arguments.file(experiment),
                "robots,time,position,yaw,nees,position_std,bias,bias_nees,scale,calibration_nees,true_bias,"
                "found_bias,bias_std,true_scale,found_scale,scale_std");
  for (const auto& [name, sensors] : robots) {
    const SensorStatistics s = simulateOtherMeasurements(sensors, options);
    for (std::size_t i = 1; i < s.pose.size(); ++i) {
      table.row(name,
                {0.2 * static_cast<double>(i), std::sqrt(s.squared_error[i]), std::sqrt(s.squared_yaw[i]), s.pose[i],
                 std::sqrt(s.variance[i]), std::sqrt(s.squared_bias[i]), s.bias[i], std::sqrt(s.squared_calibration[i]),
                 s.calibration[i], s.traced_bias.truth[i - 1], s.traced_bias.estimate[i - 1], s.traced_bias.std[i - 1],
                 s.traced_scale.truth[i - 1], s.traced_scale.estimate[i - 1], s.traced_scale.std[i - 1]});
    }
    progress.advance();
  }
  progress.finish();
}

SimulatedSensors with(SimulatedSensors sensors, const std::function<void(SimulatedSensors&)>& change) {
  change(sensors);
  return sensors;
}

void blind(SimulatedSensors& sensors) { sensors.scans_until = 0; }

void imu(const Arguments& arguments) {
  const SimulatedSensors both = with(gyro(), [](SimulatedSensors& sensors) {
    sensors.compass_std = compass().compass_std;
    sensors.states.heading_drift = compass().states.heading_drift;
  });
  otherMeasurements(arguments, "imu",
                    {{"seeing_wheels", {}},
                     {"seeing_gyro", gyro()},
                     {"seeing_orientation", compass()},
                     {"seeing_both", both},
                     {"blind_wheels", with({}, blind)},
                     {"blind_gyro", with(gyro(), blind)},
                     {"blind_orientation", with(compass(), blind)},
                     {"blind_both", with(both, blind)}},
                    40);
}

void absolutePosesOf(const Arguments& arguments) {
  otherMeasurements(arguments, "absolute_poses",
                    {{"seeing_without", {}},
                     {"seeing_with", absolutePoses()},
                     {"blind_without", with({}, blind)},
                     {"blind_with", with(absolutePoses(), blind)},
                     {"every_sensor", everySensor()}},
                    40);
  CsvFile table(arguments.file("absolute_poses_drive"), "time,odom_error,map_error,odom_step,map_step,moved");
  for (const AbsolutePosesPoint& p : simulateAbsolutePoses(arguments.absolute_poses)) {
    table.row({p.time, p.odom_error, p.map_error, p.odom_step, p.map_step, p.moved});
  }
}

void standstill(const Arguments& arguments) {
  const auto unaware = [](SimulatedSensors& sensors) { sensors.knows_that_it_stands = false; };
  const SimulatedSensors with_gyro = with(gyro(), [](SimulatedSensors& sensors) { sensors.stands = true; });
  otherMeasurements(arguments, "standstill",
                    {{"without", with(with(standingNowAndThen(), unaware), blind)},
                     {"with", with(standingNowAndThen(), blind)},
                     {"gyro_without", with(with(with_gyro, unaware), blind)},
                     {"gyro_with", with(with_gyro, blind)}},
                    40);
}

void calibration(const Arguments& arguments) {
  constexpr int kSeeing = 40;  // scans, and as long without
  const auto seeing = [](SimulatedSensors& sensors) { sensors.scans_until = kSeeing; };
  const auto trusting = [](SimulatedSensors& sensors) { sensors.calibrated = false; };
  otherMeasurements(
      arguments, "calibration",
      {{"without", with(with(wheelsThatErr(), seeing), trusting)}, {"with", with(wheelsThatErr(), seeing)}},
      2 * kSeeing);
}

/// One of the numbers that make the state large grows, the others are as they are; as far as caches hold it.
void updateCost(const Arguments& arguments) {
  std::vector<std::pair<std::string, StateSize>> sizes;
  for (const int clones : {2, 4, 8, 12, 16, 24, 32}) sizes.push_back({"clones", {clones, 0, 360}});
  for (const int landmarks : {4, 8, 16, 32, 64, 128}) sizes.push_back({"landmarks", {2, landmarks, 360}});
  for (const int ranges : {250, 500, 1000, 2000, 4000, 8000}) sizes.push_back({"ranges", {3, 0, ranges}});
  std::vector<StateSize> values;
  for (const auto& [varied, size] : sizes) values.push_back(size);
  ProgressBar progress(sizes.size());
  const std::vector<double> times = measureUpdates(values, [&progress] { progress.advance(); });
  progress.finish();
  CsvFile table(arguments.file("update_cost"), "varied,clones,landmarks,ranges,states,time");
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const auto& [varied, size] = sizes[i];
    table.row(varied, {static_cast<double>(size.clones), static_cast<double>(size.landmarks),
                       static_cast<double>(size.ranges), static_cast<double>(size.states()), times[i]});
  }
}

}  // namespace

const Experiments& extensions() {
  static const Experiments all{{"deskewing", deskewing},
                               {"cloud_input", cloudInput},
                               {"odometry_models", odometryModels},
                               {"several_lasers", severalLasers},
                               {"imu", imu},
                               {"absolute_poses", absolutePosesOf},
                               {"standstill", standstill},
                               {"calibration", calibration},
                               {"update_cost", updateCost}};
  return all;
}

}  // namespace sckf
