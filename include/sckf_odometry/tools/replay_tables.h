// The files that replay writes: trajectories in the format of TUM, and a table with a row for each scan.
#pragma once

#include <string>

#include "sckf_odometry/pipeline/scan_report.h"
#include "sckf_odometry/tools/output_file.h"

namespace sckf {

/// The stamp in seconds, digit for digit.
std::string decimal(Stamp stamp);

/// stamp [s], x, y, z [m], quaternion x, y, z, w.
void writeTumLine(OutputFile& file, Stamp stamp, const SE2& pose);

/// Of the columns of writeCsvLine(). scripts/scan_table.py reads them.
void writeCsvHeader(OutputFile& file);

/// What became of a scan: estimate, prediction, displacement [m, rad] and their covariances, innovation, match. What
/// there is none of is left empty.
void writeCsvLine(OutputFile& file, const ScanReport& report);

}  // namespace sckf
