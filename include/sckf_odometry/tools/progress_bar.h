// A bar on the terminal, for tools that take a while.
#pragma once

#include <cstddef>

namespace sckf {

/// Drawn on stderr if that is a terminal, at most a hundred times; otherwise nothing.
class ProgressBar {
 public:
  explicit ProgressBar(std::size_t total);
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;
  ~ProgressBar() { finish(); }  // before anybody says what was wrong

  void advance();
  void finish();  ///< takes the bar away

 private:
  void draw() const;

  std::size_t total_;
  std::size_t done_ = 0;
  int percent_ = -1;
  bool shown_;
};

}  // namespace sckf
