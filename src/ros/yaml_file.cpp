#include "yaml_file.h"

#include <cerrno>
#include <fstream>
#include <iterator>
#include <system_error>

namespace sckf {

// The text is read here: YAML::LoadFile leaks its buffer where the stream throws, as it does at a folder.
YAML::Node loadYamlFile(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::system_error(errno, std::generic_category());
  return YAML::Load(std::string(std::istreambuf_iterator<char>(file), {}));
}

}  // namespace sckf
