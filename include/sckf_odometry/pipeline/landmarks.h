// Which corners and lines of the scans are landmarks: when one enters the state, which one a scan sees again, when it
// is given up.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "sckf_odometry/core/landmark_states.h"
#include "sckf_odometry/pipeline/feature.h"
#include "sckf_odometry/pipeline/scan_report.h"

namespace sckf {

struct LandmarkOptions {
  std::string use = "none";  ///< one of landmarkUses()
  bool only = false;         ///< displacements are not used
  int max = 60;              ///< landmarks in the state; beyond, the one that has not been seen for longest is given up
  int sightings = 3;         ///< scans that see a corner or a line before it becomes a landmark …
  int misses = 10;           ///< … and scans that should see it and do not until it is none any more
  double max_share = 0.5;    ///< of a scan's points that landmarks may take from its match
  double max_std = 0.07;     ///< [m] a place that is known worse is not compared with what is seen
  double probability = 0.99;  ///< χ²: what is less likely than 1 − this is something else
  CornerOptions corner;
  LineOptions line;

  bool on() const { return use != "none"; }
  bool corners() const { return use == "corners" || use == "corners_and_lines"; }
  bool lines() const { return use == "lines" || use == "corners_and_lines"; }
};

/// none; corners; lines; corners_and_lines: of a line only what no corner takes.
const std::vector<std::string>& landmarkUses();

/// For each scan, in this order: claim(), the displacements if any, update(). A range has a part in a landmark or in a
/// displacement, never in both: what claim() takes out of a scan is in no match, neither as the scan nor as a
/// reference.
class Landmarks {
 public:
  explicit Landmarks(const LandmarkOptions& options) : options_(options) {}

  /// From the next scan on.
  void setOptions(const LandmarkOptions& options) { options_ = options; }

  /// Finds the corners and lines of a scan at the filter's pose and sets those aside that are, or may become,
  /// landmarks.
  std::shared_ptr<const PreparedScan> claim(std::shared_ptr<const PreparedScan> scan, const LandmarkStates& filter,
                                            const SurfaceOptions& surface);

  /// Corrects the filter by the landmarks that the scan sees again, begins new ones, gives up those that are gone.
  /// Returns how many have been used.
  int update(LandmarkStates& filter);

  std::vector<LandmarkView> views(const LandmarkStates& filter) const;

 private:
  /// What is known of a landmark beside its state; in the order of the filter's.
  struct Known {
    FeatureShape shape;
    double farthest = 0.0;  // [m] from which it has been seen
    int misses = 0;         // since it was last seen
    std::size_t seen = 0;   // number of the last scan that saw it
  };
  /// What is not, or not yet, a landmark.
  struct Candidate {
    Feature in_odom;
    int sightings = 1;
    std::size_t seen = 0;
  };
  struct Sight : FeatureSight {
    using FeatureSight::FeatureSight;
    bool claimed = false;    // its points are in no match
    bool gives_way = false;  // they would be, had the match no need of them
    bool used = false;
  };
  struct Association {
    std::size_t sight = 0;
    std::size_t landmark = 0;
    double std = 0.0;  // [m] of where the landmark was expected
  };
  enum class Stage { kClaim, kUpdate, kExcuse };

  Feature landmark(std::size_t number, const LandmarkStates& filter) const {
    return {filter.landmark(number), known_[number].shape};
  }
  void claim(std::size_t first, const LandmarkStates& filter, std::vector<bool>& aside);
  void giveWay(std::size_t first, double left);
  static bool isOf(Stage stage, const Sight& sight);
  std::vector<Association> compatible(const LandmarkStates& filter, Stage stage) const;
  bool excludeEachOther(const Association& a, const Association& b, const LandmarkStates& filter) const;
  const Association* mostCertain(const std::vector<Association>& all, const LandmarkStates& filter) const;
  void use(const Association& association, LandmarkStates& filter);
  const Candidate* candidateFor(const Feature& in_odom) const;
  bool shouldSee(const Feature& in_base, double farthest) const;
  void giveUp(std::size_t landmark, LandmarkStates& filter);
  void giveUpMissed(LandmarkStates& filter);
  bool isNearLandmark(const Feature& in_odom, const LandmarkStates& filter) const;
  void beginNew(LandmarkStates& filter);
  void remember(const Feature& in_odom);

  LandmarkOptions options_;
  std::vector<Known> known_;
  std::vector<Candidate> candidates_;
  std::size_t scans_ = 0;

  std::shared_ptr<const PreparedScan> scan_;  // the present one, whole
  std::vector<Sight> sights_;                 // its corners and lines
  std::vector<bool> corners_have_;            // of its points, those of claimed corners
};

}  // namespace sckf
