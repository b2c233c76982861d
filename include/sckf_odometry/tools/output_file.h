// A file for what a program finds.
#pragma once

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace sckf {

/// A file that is complete or not there: it gets its name when everything has been written, and nothing is left of it
/// otherwise. What a link leads to is written, and a device as it is. Without a path there is none. Throws
/// std::runtime_error, with the reason, if it cannot be written; as soon as that is known.
class OutputFile {
 public:
  explicit OutputFile(const std::string& path) : path_(path) {
    if (path_.empty()) return;
    if (std::filesystem::exists(path_)) {
      path_ = std::filesystem::canonical(path_);
      if (std::filesystem::is_directory(path_)) fail(EISDIR);
      if (access(path_.c_str(), W_OK) != 0) fail(errno);
      is_device_ = !std::filesystem::is_regular_file(path_);
    }
    file_ = std::fopen(part().c_str(), "w");
    if (file_ == nullptr) fail(errno);
  }
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  ~OutputFile() {
    if (file_ == nullptr) return;
    std::fclose(file_);
    removePart();
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
    if (error_ == 0 && (is_device_ || std::rename(part().c_str(), path_.c_str()) == 0)) return;
    if (error_ == 0) error_ = errno;
    removePart();
    fail(error_);
  }

 private:
  std::string part() const { return is_device_ ? path_ : path_ + ".part"; }
  void removePart() const {
    if (!is_device_) std::remove(part().c_str());
  }
  [[noreturn]] void fail(int error) const {
    throw std::runtime_error(path_ + ": cannot be written: " + std::strerror(error));
  }

  std::string path_;
  std::FILE* file_ = nullptr;
  bool is_device_ = false;
  int error_ = 0;  // errno of what could not be written
};

/// Whether writing the one would replace the other, or would if both were written. An empty path is no file.
inline bool isSameFile(const std::string& a, const std::string& b) {
  if (a.empty() || b.empty()) return false;
  std::error_code none_there;
  if (std::filesystem::equivalent(a, b, none_there)) return true;
  const auto written = [&none_there](const std::string& path) {
    return std::filesystem::weakly_canonical(std::filesystem::absolute(path), none_there);
  };
  return written(a) == written(b);
}

}  // namespace sckf
