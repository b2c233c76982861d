// Whether a stamp is one of a row or a wrong one.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <utility>
#include <vector>

#include "sckf_odometry/matching/laser_scan.h"

namespace sckf {

/// Lets the first message pass, and those whose stamps go on from those before them. Others are held back until the
/// next ones tell whether time has jumped or one stamp was wrong: so many in a row that go on from each other are a
/// jump.
template <typename Message>
class StampGuard {
 public:
  static constexpr std::size_t kConfirmations = 3;

  /// jump: [s] a stamp that goes back by more, or ahead by more while it is ahead of the clock too, is doubtful; so is
  /// one that goes ahead by ten times as much, unless the clock says the same.
  explicit StampGuard(double jump) : jump_(toDuration(jump)) {}

  struct Admission {
    std::vector<Message> passed;  ///< in the order in which they came
    std::size_t dropped = 0;      ///< messages that had been held back: their stamps were wrong
    Stamp time_jump{0};           ///< from the newest to the first that passed, where time has jumped
  };

  /// now: of ROS, zero if there is no time yet. other: the newest stamp of another row of the same clock, zero if there
  /// is none.
  Admission admit(Stamp stamp, const Message& message, Stamp now, Stamp other = Stamp(0)) {
    if (goesOn(stamp, now, other)) return pass(stamp, message);
    Admission admission;
    if (!held_back_.empty() && !isNear(stamp, held_back_.back().first)) admission.dropped = drop();
    held_back_.emplace_back(stamp, message);
    if (held_back_.size() < kConfirmations) return admission;
    if (newest_ != Stamp(0)) admission.time_jump = held_back_.front().first - newest_;
    newest_ = Stamp(0);
    for (const auto& [held_stamp, held] : held_back_) newest_ = std::max(newest_, held_stamp);
    for (auto& entry : held_back_) admission.passed.push_back(std::move(entry.second));
    held_back_.clear();
    return admission;
  }

  /// Another time has begun; what is held back may belong to it.
  void restart() { newest_ = Stamp(0); }

  Stamp newest() const { return newest_; }  ///< of those that passed, zero before the first
  std::size_t heldBack() const { return held_back_.size(); }

 private:
  bool isNear(Stamp stamp, Stamp before) const { return stamp + jump_ >= before && stamp <= before + 10 * jump_; }

  bool goesOn(Stamp stamp, Stamp now, Stamp other) const {
    if (stamp + jump_ < newest_) return false;
    const Stamp newest = std::max(newest_, other);
    if (newest == Stamp(0) || stamp <= newest + jump_) return true;
    if (now == Stamp(0)) return stamp <= newest + 10 * jump_;
    return stamp <= now + jump_ && (stamp <= newest + 10 * jump_ || stamp + jump_ >= now);
  }

  Admission pass(Stamp stamp, const Message& message) {
    Admission admission;
    for (auto& [held_stamp, held] : held_back_) {
      if (isNear(stamp, held_stamp)) {
        admission.passed.push_back(std::move(held));
      } else {
        ++admission.dropped;
      }
    }
    held_back_.clear();
    admission.passed.push_back(message);
    newest_ = std::max(newest_, stamp);
    return admission;
  }

  std::size_t drop() {
    const std::size_t count = held_back_.size();
    held_back_.clear();
    return count;
  }

  Stamp jump_;
  Stamp newest_{0};
  std::vector<std::pair<Stamp, Message>> held_back_;
};

}  // namespace sckf
