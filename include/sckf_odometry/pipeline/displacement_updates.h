// How a scan corrects the estimate by its displacements from references, and when it becomes one itself.
#pragma once

#include <optional>
#include <vector>

#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/matching/scan_matcher.h"
#include "sckf_odometry/pipeline/reference_policy.h"
#include "sckf_odometry/pipeline/reference_scans.h"
#include "sckf_odometry/pipeline/scan_report.h"

namespace sckf {

/// What happens to a displacement that contradicts the wheels.
struct GateOptions {
  double probability = 0.999;         ///< χ² gate: an innovation less likely than 1 − this contradicts
  bool trust_scans_on_slip = true;    ///< where the scans match well, put the contradiction down to the wheels
  double slip_std_translation = 0.5;  ///< [m] by what, beside all their way, the wheels may be wrong then …
  double slip_std_yaw = 0.5;          ///< [rad] … and in yaw
  double slip_max_misfit = 1.3;       ///< scans match well if Match::misfit is at most this …
  double slip_min_overlap = 0.6;  ///< … and where they see two directions only, this share of the points has a partner
  double doubtful_min_agreement = 0.85;  ///< agreement that a reference needs which could not be placed itself, and an
                                         ///< older one that is found far from the prediction, or tells that wheels that
                                         ///< a match contradicts are right
};

struct DisplacementOptions {
  MatcherOptions matcher;
  ReferenceOptions reference;
  GateOptions gate;
};

/// For each scan: update(), and if its report says that it is a new reference becomeReference(). Lasers have numbers,
/// and references of their own.
class DisplacementUpdates {
 public:
  DisplacementUpdates(const DisplacementOptions& options, std::size_t lasers);

  /// From the next scan on.
  void setOptions(const DisplacementOptions& options);

  /// Whether there is anything that a scan of the laser can be compared with.
  bool hasReference(std::size_t laser) const { return references_.newestOf(laser).has_value(); }

  /// Compares the scan of the report with the newest reference of its laser, of which there has to be one; corrects the
  /// estimate by the displacement if that is believed; says so in the report, and whether the scan becomes a reference.
  void update(ScanReport& report, FusionMethod& filter);

  /// Compares the scan of the report with older references of its laser, too, and makes it the newest. Where scan or
  /// wheels are wrong and nobody knows which, the estimate may be off by a slip from here on.
  void becomeReference(ScanReport& report, FusionMethod& filter);

 private:
  struct Laser {
    explicit Laser(const ReferenceOptions& options) : policy(options) {}

    ReferencePolicy policy;
    int failures = 0;             // so many scans, the last among them, were placed by no reference
    std::optional<Stamp> placed;  // the last one that was

    void place(Stamp stamp) {
      failures = 0;
      placed = stamp;
    }
  };

  bool fuse(ScanReport& report, FusionMethod& filter);
  bool isDoubtful(const ScanReport& report) const;
  void allowForSlip(FusionMethod& filter, double way) const;
  void admitFailure(const ScanReport& report, FusionMethod& filter);
  bool othersTell(Stamp stamp) const;
  void compareWithOlder(ScanReport& report, FusionMethod& filter);
  std::optional<Displacement> displacementFrom(std::size_t clone, const ScanReport& report,
                                               const FusionMethod& filter) const;
  Match matchWithOlder(const PreparedScan& reference, const PreparedScan& scan,
                       const DisplacementPrediction& prediction, bool placed) const;
  double bound(const Displacement& displacement) const;  // a larger innovation, normalised and squared, contradicts
  bool looksLikeSlip(const ScanReport& report) const;
  bool outweighsWheels(const Match& match) const;
  bool tellsAgainst(const DisplacementPrediction& prediction, const Match& match, const PreparedScan& scan) const;
  bool olderConfirmWheels(const ScanReport& report, const FusionMethod& filter) const;
  bool matchesWell(const Match& match) const;
  bool isPlaced(const Match& match) const;

  DisplacementOptions options_;
  ScanMatcher matcher_;
  ReferenceScans references_;
  std::vector<Laser> lasers_;
};

}  // namespace sckf
