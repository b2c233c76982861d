// What all of the ROS side has in common.
#pragma once

#include <cstdint>

namespace sckf {

/// Of everything that node and nodelet say.
constexpr char kLogger[] = "sckf_odometry";

/// Messages that wait to be sent: at fast replay many leave in one go.
constexpr std::uint32_t kPublisherQueue = 1000;

}  // namespace sckf
