// Tables of numbers for the plots.
#pragma once

#include <fstream>
#include <string>
#include <vector>

namespace sckf {

/// A table with named columns. Throws std::runtime_error if the file cannot be written.
class CsvFile {
 public:
  CsvFile(const std::string& path, const std::string& header);
  void row(const std::vector<double>& values);
  void row(const std::string& name, const std::vector<double>& values);  ///< the first column is a name

 private:
  void end();

  std::string path_;
  std::ofstream file_;
};

}  // namespace sckf
