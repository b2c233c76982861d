#include <gtest/gtest.h>

#include <fstream>
#include <stdexcept>
#include <variant>

#include "sckf_odometry/ros/parameters.h"
#include "temporary_folder.h"
#include "text_matchers.h"

namespace sckf {
namespace {

constexpr char kConfigFile[] = "config/sckf_odometry.yaml";  // from the root of the package

/// A parameter file that lives as long as the test.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& content) { std::ofstream(path()) << content; }
  std::string path() const { return folder_.file("parameters.yaml"); }

 private:
  TemporaryFolder folder_;
};

Options read(const std::string& yaml, std::vector<std::string>* warnings = nullptr) {
  const TemporaryFile file(yaml);
  return readOptions(ParameterFile(file.path()), warnings);
}

std::string refusal(const std::string& yaml) {
  try {
    read(yaml);
  } catch (const std::invalid_argument& exception) {
    return exception.what();
  }
  return "accepted";
}

/// The value that a parameter's field has.
using Value = std::variant<bool, int, std::size_t, double, std::string, std::vector<std::string>>;
Value valueOf(const Parameter& parameter) {
  return std::visit([](auto* field) { return Value(*field); }, parameter.field);
}

TEST(Parameters, AnEmptyFileLeavesTheDefaults) {
  Options read_options = read("");
  Options defaults;
  const auto got = parameterList(read_options);
  const auto expected = parameterList(defaults);
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_EQ(valueOf(got[i]), valueOf(expected[i])) << got[i].name;
}

TEST(Parameters, TheDefaultsAreAllowed) {
  Options defaults;
  for (const Parameter& parameter : parameterList(defaults)) {
    if (const auto* field = std::get_if<double*>(&parameter.field)) {
      EXPECT_TRUE(parameter.range.contains(**field)) << parameter.name;
    }
    if (const auto* field = std::get_if<int*>(&parameter.field)) {
      EXPECT_TRUE(parameter.range.contains(**field)) << parameter.name;
    }
    if (const auto* field = std::get_if<std::size_t*>(&parameter.field)) {
      EXPECT_TRUE(parameter.range.contains(static_cast<double>(**field))) << parameter.name;
    }
  }
}

TEST(Parameters, TheConfiguredFileNamesEveryParameterWithItsDefault) {
  const ParameterFile file(kConfigFile);
  Options defaults;
  for (const Parameter& parameter : parameterList(defaults)) {
    EXPECT_EQ(file.values().count(parameter.name), 1u) << parameter.name << " is not in " << kConfigFile;
  }
  std::vector<std::string> warnings;
  Options configured = readOptions(file, &warnings);
  EXPECT_TRUE(warnings.empty());
  const auto got = parameterList(configured);
  const auto expected = parameterList(defaults);
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_EQ(valueOf(got[i]), valueOf(expected[i])) << got[i].name;
}

TEST(Parameters, EveryNameIsThereOnce) {
  Options options;
  std::map<std::string, int> count;
  for (const Parameter& parameter : parameterList(options)) ++count[parameter.name];
  for (const auto& [name, n] : count) EXPECT_EQ(n, 1) << name;
}

TEST(Parameters, EachKindOfValueReachesItsField) {
  const Options options = read(
      "odom_frame: sckf_odom\npublish_tf: no\nkf_dist_linear: 3\ngate_probability: 0.9\nmax_iterations: 7\n"
      "max_waiting_scans: 3\nmethod: sckf_nc\n");
  EXPECT_EQ(options.node.odom_frame, "sckf_odom");
  EXPECT_FALSE(options.node.publish_tf);
  EXPECT_EQ(options.pipeline.reference.kf_dist_linear, 3.0);
  EXPECT_EQ(options.pipeline.gate.probability, 0.9);
  EXPECT_EQ(options.pipeline.matcher.max_iterations, 7);
  EXPECT_EQ(options.pipeline.max_waiting_scans, 3);
  EXPECT_EQ(options.pipeline.method, "sckf_nc");
}

TEST(Parameters, LasersAreAListOfTopics) {
  const Options options = read("scan_topics: [front, 'rear/scan']\n");
  EXPECT_EQ(options.node.scan_topics, (std::vector<std::string>{"front", "rear/scan"}));
  EXPECT_EQ(options.pipeline.lasers, 2U);
  for (const char* bad : {"scan_topics: scan", "scan_topics: []", "scan_topics: [scan, '']", "scan_topics: [scan, 3]",
                          "scan_topics: [scan, scan]", "scan_topics: [[scan]]", "scan_topics: 7"}) {
    EXPECT_TRUE(contains(refusal(bad), "a list of texts, of which none is empty and none comes twice, expected"))
        << bad;
  }
  EXPECT_TRUE(contains(refusal("odom_frame: [a, b]"), "odom_frame = [a, b]: a text that is not empty expected"));
  EXPECT_TRUE(contains(refusal("{scan_topics: [a, b], method: sckf}"),
                       "scan_topics has 2 topics: one expected with method \"sckf\""));
}

TEST(Parameters, ANumberThatYamlTakesForATextIsANumber) {
  EXPECT_EQ(read("odometry_yaw_per_meter: '1e-3'\n").pipeline.odometry_noise.yaw_per_meter, 1e-3);
}

TEST(Parameters, LeadingSlashesOfFramesAreDropped) {
  const Options options = read("odom_frame: /odom\nbase_frame: /base_footprint\n");
  EXPECT_EQ(options.node.odom_frame, "odom");
  EXPECT_EQ(options.node.base_frame, "base_footprint");
}

TEST(Parameters, ABadValueIsRefusedByNameValueAndAllowedRange) {
  EXPECT_TRUE(contains(refusal("gate_probability: 1.5\n"), "gate_probability = 1.5: a number in (0, 1) expected"));
  EXPECT_TRUE(contains(refusal("gate_probability: .nan\n"), "gate_probability = .nan: a number in (0, 1)"));
  EXPECT_TRUE(contains(refusal("kf_dist_linear: -0.1\n"), "kf_dist_linear = -0.1: a number in [0, 1000] m"));
  EXPECT_TRUE(contains(refusal("kf_dist_linear: .inf\n"), "kf_dist_linear = .inf"));
  EXPECT_TRUE(contains(refusal("kf_dist_linear: far\n"), "kf_dist_linear = \"far\": a number"));
  EXPECT_TRUE(contains(refusal("kf_dist_linear: [1, 2]\n"), "kf_dist_linear = [1, 2]: a number"));
  EXPECT_TRUE(contains(refusal("kf_dist_linear: true\n"), "kf_dist_linear = true: a number"));
  EXPECT_TRUE(contains(refusal("max_iterations: 2.5\n"), "max_iterations = 2.5: a whole number in [1, 1000]"));
  EXPECT_TRUE(contains(refusal("max_iterations: 0\n"), "max_iterations = 0: a whole number in [1, 1000]"));
  EXPECT_TRUE(contains(refusal("publish_tf: 1\n"), "publish_tf = 1: true or false expected"));
  EXPECT_TRUE(contains(refusal("publish_tf: 'true'\n"), "publish_tf = \"true\": true or false expected"));
  EXPECT_TRUE(contains(refusal("odom_frame: ''\n"), "odom_frame = \"\": a text that is not empty expected"));
  EXPECT_TRUE(contains(refusal("odom_frame: 3\n"), "odom_frame = 3: a text"));
  EXPECT_TRUE(contains(refusal("state_file: 3\n"), "state_file = 3: a text expected"));
  EXPECT_TRUE(contains(refusal("path_distance: -1\n"), "path_distance = -1: a number of at least 0 m"));
  EXPECT_TRUE(contains(refusal("time_jump: 0\n"), "time_jump = 0: a number above 0 s"));
  EXPECT_TRUE(contains(refusal("queue_size: -1\n"), "queue_size = -1: a whole number in [1, 1e+06] messages"));
  EXPECT_TRUE(contains(refusal("method: icp\n"), "method = \"icp\": one of \"sckf_multi\" \"sckf\""));
}

TEST(Parameters, EveryBadValueIsNamedAtOnce) {
  const std::string text = refusal("gate_probability: 2\nmax_iterations: 0\npublish_tf: maybe\n");
  EXPECT_TRUE(contains(text, "gate_probability"));
  EXPECT_TRUE(contains(text, "max_iterations"));
  EXPECT_TRUE(contains(text, "publish_tf"));
}

TEST(Parameters, ValuesThatContradictEachOtherAreRefused) {
  EXPECT_TRUE(contains(refusal("range_min: 5.0\nrange_max: 4.0\n"), "range_min = 5: less than range_max = 4 expected"));
  EXPECT_TRUE(contains(refusal("range_noise_min: 0.2\n"), "range_noise_min = 0.2: less than range_noise_max"));
  EXPECT_TRUE(contains(refusal("corner_min_length: 2.0\n"), "corner_min_length = 2: less than corner_max_length"));
  EXPECT_TRUE(
      contains(refusal("odom_frame: base_link\n"), "odom_frame = \"base_link\": another frame than base_frame"));
  EXPECT_TRUE(contains(refusal("publish_map_tf: true\n"), "publish_map_tf = true: only with use_pose_updates = true"));
  EXPECT_TRUE(contains(refusal("map_frame: /odom\n"), "map_frame = \"odom\": another frame than odom_frame and base"));
}

TEST(Parameters, TopicsThatAreTheSameInTheEndAreRefusedByName) {
  checkTopics({"scan", "rear/scan"}, {"/scan", "/rear/scan"});
  try {
    checkTopics({"scan", "rear/scan", "/scan"}, {"/scan", "/rear/scan", "/scan"});
    ADD_FAILURE() << "accepted";
  } catch (const std::invalid_argument& exception) {
    EXPECT_STREQ(exception.what(),
                 "scan_topics has \"scan\" and \"/scan\": both are /scan, topics of which none comes twice expected");
  }
}

TEST(Parameters, UnknownNamesAreToldAndChangeNothing) {
  std::vector<std::string> warnings;
  const Options options = read("kf_dist_linaer: 3.0\nscan:\n  publisher: 1.0\n", &warnings);
  EXPECT_EQ(warnings, (std::vector<std::string>{
                          "unknown parameter kf_dist_linaer: no effect; is kf_dist_linear meant?",
                          "unknown parameter scan/publisher: no effect; the names are in config/sckf_odometry.yaml"}));
  EXPECT_EQ(options.pipeline.reference.kf_dist_linear, ReferenceOptions().kf_dist_linear);
}

TEST(Parameters, AMisspeltNameIsNearToWhatWasMeant) {
  for (const auto& [misspelt, meant] : std::map<std::string, std::string>{{"publsih_tf", "publish_tf"},
                                                                          {"Method", "method"},
                                                                          {"odometry_time_out", "odometry_timeout"},
                                                                          {"tf_odometry_fram", "tf_odometry_frame"}}) {
    std::vector<std::string> warnings;
    read(misspelt + ": 1\n", &warnings);
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_TRUE(contains(warnings[0], "is " + meant + " meant?"));
  }
}

TEST(Parameters, NamesOfOtherPackagesAreTakenWithAWarning) {
  std::vector<std::string> warnings;
  Options options = read("fixed_frame: world\nbase_link_frame: /base_footprint\n", &warnings);
  EXPECT_EQ(options.node.odom_frame, "world");
  EXPECT_EQ(options.node.base_frame, "base_footprint");
  EXPECT_EQ(warnings,
            (std::vector<std::string>{"parameter base_link_frame = \"/base_footprint\": it is called base_frame here",
                                      "parameter fixed_frame = \"world\": it is called odom_frame here"}));
}

TEST(Parameters, WhereBothNamesAreGivenOursHolds) {
  std::vector<std::string> warnings;
  const Options options = read("fixed_frame: world\nodom_frame: odom2\n", &warnings);
  EXPECT_EQ(options.node.odom_frame, "odom2");
  EXPECT_EQ(warnings,
            (std::vector<std::string>{"parameter fixed_frame = \"world\": it is called odom_frame here, and is "
                                      "set to \"odom2\", which holds"}));
}

TEST(Parameters, ABadValueByAnotherPackagesNameIsRefused) {
  EXPECT_TRUE(contains(refusal("fixed_frame: 3\n"), "odom_frame = 3: a text"));
}

TEST(Parameters, EveryAliasLeadsToAParameterAndIsNone) {
  Options options;
  std::map<std::string, int> known;
  for (const Parameter& parameter : parameterList(options)) ++known[parameter.name];
  for (const auto& [alias, name] : parameterAliases()) {
    EXPECT_EQ(known.count(name), 1u) << name;
    EXPECT_EQ(known.count(alias), 0u) << alias;
  }
}

TEST(Parameters, WhatIsNotGivenStaysAsItWas) {
  const TemporaryFile file("kf_dist_linear: 2\n");
  Options before;
  before.node.odom_frame = "sckf_odom";
  const Options after = readOptions(ParameterFile(file.path()), nullptr, before);
  EXPECT_EQ(after.node.odom_frame, "sckf_odom");
  EXPECT_EQ(after.pipeline.reference.kf_dist_linear, 2.0);
}

TEST(Parameters, AFileThatCannotBeReadIsNamed) {
  EXPECT_TRUE(contains(refusal("- a\n- list\n"), "parameters.yaml: yaml-cpp"));
  for (const auto& [path, reason] : {std::pair(std::string("/nowhere/parameters.yaml"), "No such file or directory"),
                                     std::pair(testing::TempDir(), "Is a directory")}) {
    try {
      ParameterFile{path};
      ADD_FAILURE() << path << " was read";
    } catch (const std::invalid_argument& exception) {
      EXPECT_TRUE(contains(exception.what(), "parameter file " + path + ": "));
      EXPECT_TRUE(contains(exception.what(), reason));
    }
  }
  EXPECT_TRUE(contains(refusal("odom_frame: [unclosed\n"), "parameters.yaml: yaml-cpp"));
}

}  // namespace
}  // namespace sckf
