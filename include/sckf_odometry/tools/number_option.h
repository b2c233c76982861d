// Numbers of the command line, refused by option, value and range.
#pragma once

#include <boost/program_options.hpp>
#include <limits>
#include <sstream>
#include <string>
#include <type_traits>

namespace sckf {

/// From low on, or above it; up to high, if there is one.
template <typename T>
struct NumberRange {
  T low;
  T high = std::numeric_limits<T>::max();
  bool above = false;     ///< low itself is none of it
  const char* unit = "";  ///< as " s"

  bool has(T value) const { return (above ? value > low : value >= low) && value <= high; }

  std::string text() const {
    const bool has_end = high < std::numeric_limits<T>::max();
    std::ostringstream text;
    if (std::is_integral<T>::value) text << "a whole number, ";
    text << (above ? "more than " : "") << low;
    if (has_end) text << (above ? ", up to " : " to ") << high;
    text << unit << (has_end || above ? "" : " or more");
    return text.str();
  }
};

/// The whole text as a number of the range; else boost::program_options::error says what is expected.
template <typename T>
T numberOf(const std::string& option, const std::string& text, const NumberRange<T>& range) {
  std::istringstream stream(text);
  T value{};
  // A stream takes "-1" for a large number without a sign.
  const bool begins = (std::is_signed<T>::value || text.find('-') == std::string::npos) && stream >> value;
  if (!begins || stream.peek() != std::istringstream::traits_type::eof() || !range.has(value)) {
    throw boost::program_options::error("--" + option + " " + text + ": expected " + range.text());
  }
  return value;
}

/// An option for such a number, which the target becomes when the options are notified.
template <typename T>
boost::program_options::typed_value<std::string>* number(const std::string& option, T& target,
                                                         const NumberRange<T>& range) {
  return boost::program_options::value<std::string>()->notifier(
      [option, &target, range](const std::string& text) { target = numberOf(option, text, range); });
}

}  // namespace sckf
