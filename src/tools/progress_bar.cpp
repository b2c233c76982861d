#include "sckf_odometry/tools/progress_bar.h"

#include <unistd.h>

#include <cstdio>
#include <string>

namespace sckf {

ProgressBar::ProgressBar(std::size_t total) : total_(total), shown_(total > 0 && isatty(STDERR_FILENO) != 0) {}

void ProgressBar::advance() {
  ++done_;
  if (!shown_) return;
  const int percent = static_cast<int>(100 * done_ / total_);
  if (percent == percent_) return;
  percent_ = percent;
  draw();
}

void ProgressBar::finish() {
  if (shown_) std::fprintf(stderr, "\r%60s\r", "");
  shown_ = false;
}

void ProgressBar::draw() const {
  const auto full = static_cast<std::size_t>(percent_ / 2);
  std::fprintf(stderr, "\r[%s%s] %3d %%", std::string(full, '#').c_str(), std::string(50 - full, ' ').c_str(),
               percent_);
  std::fflush(stderr);
}

}  // namespace sckf
