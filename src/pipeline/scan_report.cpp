#include "sckf_odometry/pipeline/scan_report.h"

namespace sckf {

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

std::string toString(HeadingUse use) {
  switch (use) {
    case HeadingUse::kNone:
      return "none";
    case HeadingUse::kUsed:
      return "used";
    case HeadingUse::kContradicts:
      return "contradicts";
  }
  return "unknown";
}

bool wasUsed(ScanOutcome outcome) { return outcome == ScanOutcome::kUpdated || outcome == ScanOutcome::kSlip; }

ScanReport notUsed(Stamp stamp, std::size_t laser, ScanOutcome outcome, const std::string& reason) {
  ScanReport report;
  report.stamp = stamp;
  report.laser = laser;
  report.outcome = outcome;
  report.reason = reason;
  return report;
}

}  // namespace sckf
