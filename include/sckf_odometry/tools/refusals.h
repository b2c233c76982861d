// What a program does not use, said without a flood.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <map>
#include <string>

#include "sckf_odometry/matching/laser_scan.h"

namespace sckf {

/// Says on stderr why a message is not used; reasons that differ in their numbers only, once and with a count.
class Refusals {
 public:
  void add(const std::string& what, Stamp stamp, const std::string& reason) {
    Kind& kind = kinds_[withoutNumbers(what + ": " + reason)];
    kind = {what, stamp, reason, kind.count + 1};
    if (kind.count == 1) say(kind);
  }

  /// How often each came again, and what was said last.
  void finish() const {
    for (const auto& [key, kind] : kinds_) {
      if (kind.count == 1) continue;
      std::fprintf(stderr, "%zu of these, the last one: ", kind.count);
      say(kind);
    }
  }

 private:
  struct Kind {
    std::string what;
    Stamp stamp;
    std::string reason;
    std::size_t count = 0;
  };

  static std::string withoutNumbers(std::string text) {
    const auto is_of_number = [](char c) { return (c >= '0' && c <= '9') || c == '.' || c == '-'; };
    text.erase(std::remove_if(text.begin(), text.end(), is_of_number), text.end());
    return text;
  }

  static void say(const Kind& kind) {
    std::fprintf(stderr, "%s at %.9f not used: %s\n", kind.what.c_str(), seconds(kind.stamp), kind.reason.c_str());
  }

  std::map<std::string, Kind> kinds_;
};

}  // namespace sckf
