// Files that a user may write, or name by mistake.
#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

namespace sckf {

/// Throws std::system_error if nothing can be read (no file, a folder), YAML::Exception if what is read is no YAML.
YAML::Node loadYamlFile(const std::string& path);

}  // namespace sckf
