// Assertions on messages for the user.
#pragma once

#include <gtest/gtest.h>

#include <string>

namespace sckf {

inline testing::AssertionResult contains(const std::string& text, const std::string& part) {
  if (text.find(part) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "\"" << text << "\" does not contain \"" << part << "\"";
}

}  // namespace sckf
