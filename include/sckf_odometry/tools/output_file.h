// A file for what a program finds.
#pragma once

#include <cstdio>
#include <stdexcept>
#include <string>

namespace sckf {

/// A file that is complete or not there: it gets its name when everything has been written. Without a path there is
/// none. Throws std::runtime_error if it cannot be written.
class OutputFile {
 public:
  explicit OutputFile(const std::string& path) : path_(path) {
    if (path_.empty()) return;
    file_ = std::fopen((path_ + ".part").c_str(), "w");
    if (file_ == nullptr) throw std::runtime_error(path_ + ": cannot be written");
  }
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  ~OutputFile() {
    if (file_ != nullptr) std::fclose(file_);
  }

  explicit operator bool() const { return file_ != nullptr; }

  template <typename... Values>
  void print(const char* format, Values... values) {
    std::fprintf(file_, format, values...);
  }

  void finish() {
    if (file_ == nullptr) return;
    const bool failed = std::ferror(file_) != 0;
    const bool closed = std::fclose(file_) == 0;
    file_ = nullptr;
    if (failed || !closed || std::rename((path_ + ".part").c_str(), path_.c_str()) != 0) {
      throw std::runtime_error(path_ + ": cannot be written");
    }
  }

 private:
  std::string path_;
  std::FILE* file_ = nullptr;
};

}  // namespace sckf
