// How a scan corrects the estimate by its displacements from references, and when it becomes one itself.
#pragma once

#include <optional>
#include <vector>

#include "sckf_odometry/core/fusion_method.h"
#include "sckf_odometry/matching/scan_matcher.h"
#include "sckf_odometry/pipeline/displacement_gate.h"
#include "sckf_odometry/pipeline/reference_policy.h"
#include "sckf_odometry/pipeline/reference_scans.h"
#include "sckf_odometry/pipeline/scan_report.h"

namespace sckf {

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
  bool isDoubtful(const ScanReport& report, const Comparison& comparison) const;
  void allowForSlip(FusionMethod& filter, double way) const;
  void admitFailure(const ScanReport& report, FusionMethod& filter);
  bool othersTell(Stamp stamp) const;
  void compareWithOlder(ScanReport& report, FusionMethod& filter);
  std::optional<Displacement> displacementFrom(std::size_t clone, const ScanReport& report,
                                               const FusionMethod& filter) const;
  Match matchWithOlder(const PreparedScan& reference, const PreparedScan& scan,
                       const DisplacementPrediction& prediction, bool placed) const;
  bool olderConfirmWheels(const ScanReport& report, const FusionMethod& filter) const;

  DisplacementOptions options_;
  ScanMatcher matcher_;
  DisplacementGate gate_;
  ReferenceScans references_;
  std::vector<Laser> lasers_;
};

}  // namespace sckf
