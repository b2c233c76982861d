// The simulations of the paper's experiments and of the extensions, as tables: what the script `experiment` draws.
#include <algorithm>
#include <boost/program_options.hpp>
#include <cmath>
#include <filesystem>
#include <functional>
#include <iostream>
#include <limits>
#include <map>
#include <sstream>

#include "sckf_odometry/experiments/complexity.h"
#include "sckf_odometry/experiments/csv_file.h"
#include "sckf_odometry/tools/command_line.h"
#include "sckf_odometry/tools/experiment_arguments.h"
#include "sckf_odometry/tools/number_option.h"
#include "sckf_odometry/tools/progress_bar.h"

namespace sckf {

namespace {

std::vector<double> logSpaced(double low, double high, int count) {
  std::vector<double> values;
  for (int i = 0; i < count; ++i) values.push_back(low * std::pow(high / low, static_cast<double>(i) / (count - 1)));
  return values;
}

std::vector<double> operator+(std::vector<double> a, const Eigen::Vector3d& b) {
  a.insert(a.end(), b.data(), b.data() + b.size());
  return a;
}

void oneDimension(const Arguments& arguments) {
  const OneDimensionOptions& options = arguments.one_dimension;
  CsvFile curves(arguments.file("one_dimension_closed_form"), "spacing,with_c,with_c_and_first,without_c");
  for (int i = 0; i <= 100; ++i) {
    const double spacing = (0.01 + 0.009 * i) * options.field;
    const double with = closedForm(options, spacing);
    curves.row({spacing, with, with + firstDisplacementExcess(options, spacing),
                closedFormWithoutCorrelations(options, spacing)});
  }
  std::vector<double> spacings{0.01, 0.02, 0.03, 0.05};
  for (int i = 1; i <= 9; ++i) spacings.push_back(0.1 * i);
  for (double& spacing : spacings) spacing *= options.field;
  ProgressBar progress(spacings.size());
  const auto points = simulateOneDimension(options, spacings, [&progress] { progress.advance(); });
  progress.finish();
  CsvFile simulated(arguments.file("one_dimension_simulated"), "spacing,runs,with_c,without_c,squared_error");
  for (const OneDimensionPoint& p : points) {
    simulated.row({p.spacing, static_cast<double>(options.runs), p.with_correlations, p.without, p.squared_error});
  }
}

void writeRatio(CsvFile& table, const std::string& parameter, double value, const LineMatchingOptions& options,
                const std::function<void()>& tick) {
  const auto with = simulateLineMatching(options, "sckf", tick);
  const auto without = simulateLineMatching(options, "sckf_nc", tick);
  const Eigen::Vector3d ratio = rootMeanSquare(with).cwiseQuotient(rootMeanSquare(without));
  table.row(parameter, std::vector<double>{value} + ratio);
}

/// The ratio of the rms errors, each parameter varied alone.
void lineMatchingRatios(const Arguments& arguments) {
  LineMatchingOptions base = arguments.line_matching;
  base.runs = std::max(10, base.runs / 2);
  const std::vector<double> factors{0.25, 0.5, 1.0, 2.0, 4.0};
  CsvFile table(arguments.file("line_matching_ratios"), "parameter,value,x,y,yaw");
  ProgressBar progress(3 * factors.size() * 2 * static_cast<std::size_t>(base.runs));
  const auto tick = [&progress] { progress.advance(); };
  const std::map<std::string, double LineMatchingOptions::*> parameters{
      {"range_std", &LineMatchingOptions::range_std},
      {"odometry_noise", &LineMatchingOptions::odometry_noise},
      {"spacing", &LineMatchingOptions::spacing}};
  for (const auto& [name, member] : parameters) {
    for (const double factor : factors) {
      LineMatchingOptions options = base;
      options.*member *= factor;
      writeRatio(table, name, options.*member, options, tick);
    }
  }
  progress.finish();
}

void lineMatching(const Arguments& arguments) {
  const LineMatchingOptions& options = arguments.line_matching;
  ProgressBar progress(2 * static_cast<std::size_t>(options.runs));
  for (const std::string method : {"sckf", "sckf_nc"}) {
    CsvFile table(arguments.file("line_matching_" + method),
                  "way,runs,error_x,error_y,error_yaw,std_x,std_y,std_yaw,squared_x,squared_y,squared_yaw,"
                  "variance_x,variance_y,variance_yaw,normalized_x,normalized_y,normalized_yaw,"
                  "inside_x,inside_y,inside_yaw,nees");
    for (const auto& s : simulateLineMatching(options, method, [&progress] { progress.advance(); })) {
      const std::vector<double> row = std::vector<double>{s.way, static_cast<double>(options.runs)} +
                                      s.error_of_first_run + s.std + s.squared_error + s.variance +
                                      s.normalized_square + s.inside;
      std::vector<double> whole = row;
      whole.push_back(s.nees);
      table.row(whole);
    }
  }
  progress.finish();
  lineMatchingRatios(arguments);
}

void visualOdometry(const Arguments& arguments) {
  const VisualOdometryOptions& options = arguments.visual_odometry;
  std::vector<double> spacings;
  for (const double share : {0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55}) {
    spacings.push_back(share * options.camera.far);
  }
  ProgressBar progress(spacings.size() * static_cast<std::size_t>(options.runs));
  const auto points = simulateVisualOdometry(options, spacings, [&progress] { progress.advance(); });
  progress.finish();
  CsvFile table(arguments.file("visual_odometry"),
                "spacing,runs,position_with_c,position_without_c,position_scatter,attitude_with_c,"
                "attitude_without_c,attitude_scatter,shared_features,mean_error");
  for (const VisualOdometryPoint& p : points) {
    table.row({p.spacing, static_cast<double>(options.runs), p.with_correlations.position, p.without.position,
               p.scatter.position, p.with_correlations.attitude, p.without.attitude, p.scatter.attitude, p.features,
               p.mean_error});
  }
}

void complexity(const Arguments& arguments) {
  constexpr int kMaxDense = 3200;  // 80 MB; of 10 000 ranges it would be 800
  std::vector<int> ranges;
  for (const double m : logSpaced(100.0, 10000.0, 13)) ranges.push_back(static_cast<int>(std::lround(m)));
  ProgressBar progress(ranges.size());
  const auto times = measureUpdates(ranges, kMaxDense, [&progress] { progress.advance(); });
  progress.finish();
  CsvFile table(arguments.file("complexity"), "ranges,sckf,sckf_nc,dense");
  for (const UpdateTimes& t : times) table.row({static_cast<double>(t.ranges), t.sckf, t.sckf_nc, t.dense});
}

const Experiments& experiments() {
  static const Experiments all = [] {
    Experiments of_the_paper{{"one_dimension", oneDimension},
                             {"line_matching", lineMatching},
                             {"visual_odometry", visualOdometry},
                             {"complexity", complexity}};
    of_the_paper.insert(extensions().begin(), extensions().end());
    return of_the_paper;
  }();
  return all;
}

/// Adds options for numbers, each with what it is by default.
class NumberOptions {
 public:
  explicit NumberOptions(const std::string& caption) : options_(caption) {}

  template <typename T>
  NumberOptions& operator()(const std::string& name, T& target, const NumberRange<T>& range, const char* description) {
    std::ostringstream by_default;
    by_default << target;
    options_.add_options()(name.c_str(), number(name, target, range)->default_value(by_default.str()), description);
    return *this;
  }

  const boost::program_options::options_description& all() const { return options_; }

 private:
  boost::program_options::options_description options_;
};

boost::program_options::options_description optionsFor(Arguments& a) {
  namespace po = boost::program_options;
  constexpr bool kAbove = true;
  po::options_description shown("options");
  // clang-format off
  shown.add_options()("help,h", "show this help")
    ("output", po::value(&a.output)->default_value(a.output), "folder for the tables");
  NumberOptions any("of more than one");
  any("runs", a.runs, {0, 1000000}, "of the Monte Carlo simulation; 0: 400, 200 and 40 of the first three below, 400 of odometry_models, 200 of the other extensions")
    ("seed", a.seed, {0, std::numeric_limits<std::int64_t>::max()}, "of the random numbers");
  NumberOptions one("one_dimension");
  one("density", a.one_dimension.density, {0.0, 1000.0, kAbove}, "features per metre")
    ("field", a.one_dimension.field, {0.0, a.one_dimension.way, kAbove, " m"}, "range of the sensor [m]")
    ("distance-std", a.one_dimension.range_std, {0.0, 10.0, kAbove, " m"}, "std of a distance [m]");
  NumberOptions line("line_matching");
  line("range-std", a.line_matching.range_std, {0.0, 10.0, kAbove, " m"}, "std of a range [m]")
    ("odometry-noise", a.line_matching.odometry_noise, {0.0, 10.0, kAbove}, "std of the wheels after 1 m [m and rad]")
    ("spacing", a.line_matching.spacing, {0.01, 5.0, !kAbove, " m"}, "of the scans [m]")
    ("beams", a.line_matching.beams, {8, 10000}, "of a scan")
    ("laps", a.line_matching.laps, {0.5, 100.0}, "times around the circle");
  NumberOptions stereo("visual_odometry");
  stereo("pixel-std", a.visual_odometry.pixel_std, {0.0, 10.0, kAbove}, "std of a pixel coordinate")
    ("features", a.visual_odometry.features, {0.0, 10.0, kAbove}, "per cubic metre")
    ("far", a.visual_odometry.camera.far, {a.visual_odometry.camera.near, 50.0, kAbove, " m"},
     "depth of the farthest features [m]");
  NumberOptions sweeps("deskewing");
  sweeps("sweep", a.deskewing.sweep, {0.0, 1.0 / a.deskewing.run.scan_rate, !kAbove, " s"},
         "from the first beam of a scan to the last [s]");
  NumberOptions clouds("cloud_input");
  clouds("rings", a.cloud_input.rings, {2, 128}, "of the lidar")
    ("pitch", a.cloud_input.pitch, {-1.0, 1.0, !kAbove, " rad"}, "of the lidar, forward [rad]");
  // clang-format on
  for (const NumberOptions* of : {&any, &one, &line, &stereo, &sweeps, &clouds}) shown.add(of->all());
  return shown;
}

/// False if the help was asked for, and shown.
bool parse(int argc, char** argv, Arguments& arguments) {
  namespace po = boost::program_options;
  const po::options_description shown = optionsFor(arguments);
  po::variables_map values = parseCommandLine(argc, argv, shown, {{"name", &arguments.name}});
  if (values.count("help") != 0) {
    std::cout << "usage: experiment_data NAME --output DIR [options]\n\nNAME:";
    for (const auto& [name, experiment] : experiments()) std::cout << " " << name;
    std::cout << "\n\nSimulates an experiment of the paper, or of what goes beyond it, and writes its numbers.\n\n"
              << shown;
    return false;
  }
  po::notify(values);
  if (experiments().count(arguments.name) == 0) throw po::error("there is no experiment of that name; see --help");
  if (arguments.runs > 0) {
    arguments.one_dimension.runs = arguments.line_matching.runs = arguments.visual_odometry.runs = arguments.runs;
    arguments.odometry_models.runs = arguments.several_lasers.runs = arguments.other_measurements.runs = arguments.runs;
  }
  arguments.one_dimension.seed = arguments.line_matching.seed = arguments.visual_odometry.seed = arguments.seed;
  arguments.deskewing.seed = arguments.cloud_input.seed = arguments.odometry_models.seed = arguments.seed;
  arguments.several_lasers.seed = arguments.mounted_lasers.seed = arguments.seed;
  arguments.other_measurements.seed = arguments.absolute_poses.seed = arguments.seed;
  return true;
}

}  // namespace

}  // namespace sckf

int main(int argc, char** argv) {
  try {
    sckf::Arguments arguments;
    if (!sckf::parse(argc, argv, arguments)) return 0;
    std::filesystem::create_directories(arguments.output);
    sckf::experiments().at(arguments.name)(arguments);
    return 0;
  } catch (const boost::program_options::error& error) {
    std::cerr << "experiment_data: " << error.what() << '\n';
    return 2;
  } catch (const std::exception& error) {
    std::cerr << "experiment_data: " << error.what() << '\n';
    return 1;
  }
}
