// Names of topics of the command line.
#pragma once

#include <ros/names.h>

#include <boost/program_options.hpp>
#include <string>

namespace sckf {

/// As bags name it.
inline std::string resolved(const std::string& topic) {
  return !topic.empty() && topic.front() == '/' ? topic : "/" + topic;
}

/// The same, of what an option has been given; boost::program_options::error if it is no name of a topic.
inline std::string topicOf(const std::string& option, const std::string& text) {
  const std::string topic = resolved(text);
  std::string why;
  if (topic.find_first_not_of('/') == std::string::npos || !ros::names::validate(topic, why)) {
    throw boost::program_options::error("--" + option + " '" + text +
                                        "': expected the name of a topic: letters, digits, _ and /");
  }
  return topic;
}

}  // namespace sckf
