#include "sckf_odometry/experiments/csv_file.h"

#include <stdexcept>

namespace sckf {

CsvFile::CsvFile(const std::string& path, const std::string& header) : path_(path), file_(path) {
  file_.precision(10);
  file_ << header;
  end();
}

void CsvFile::row(const std::vector<double>& values) {
  const char* separator = "";
  for (const double value : values) {
    file_ << separator << value;
    separator = ",";
  }
  end();
}

void CsvFile::row(const std::string& name, const std::vector<double>& values) {
  file_ << name << ",";
  row(values);
}

void CsvFile::end() {
  file_ << '\n';
  if (!file_.flush()) throw std::runtime_error(path_ + ": cannot be written");
}

}  // namespace sckf
