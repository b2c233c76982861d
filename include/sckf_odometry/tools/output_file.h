// A file for what a program finds.
#pragma once

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace sckf {

/// A file that is complete or not there: it gets its name when everything has been written, and nothing is left of it
/// otherwise. Without a path there is none. Throws std::runtime_error, with the reason, if it cannot be written; as
/// soon as that is known.
class OutputFile {
 public:
  explicit OutputFile(const std::string& path) : path_(path) {
    if (path_.empty()) return;
    if (std::filesystem::is_directory(path_)) fail(EISDIR);
    file_ = std::fopen(part().c_str(), "w");
    if (file_ == nullptr) fail(errno);
  }
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  ~OutputFile() {
    if (file_ == nullptr) return;
    std::fclose(file_);
    std::remove(part().c_str());
  }

  explicit operator bool() const { return file_ != nullptr; }

  template <typename... Values>
  void print(const char* format, Values... values) {
    if (std::fprintf(file_, format, values...) < 0) error_ = errno;
  }

  void finish() {
    if (file_ == nullptr) return;
    if (std::fclose(file_) != 0) error_ = errno;
    file_ = nullptr;
    if (error_ == 0 && std::rename(part().c_str(), path_.c_str()) == 0) return;
    if (error_ == 0) error_ = errno;
    std::remove(part().c_str());
    fail(error_);
  }

 private:
  std::string part() const { return path_ + ".part"; }
  [[noreturn]] void fail(int error) const {
    throw std::runtime_error(path_ + ": cannot be written: " + std::strerror(error));
  }

  std::string path_;
  std::FILE* file_ = nullptr;
  int error_ = 0;  // errno of what could not be written
};

}  // namespace sckf
