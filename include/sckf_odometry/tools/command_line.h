// The command line of a program.
#pragma once

#include <boost/program_options.hpp>
#include <string>
#include <utility>
#include <vector>

namespace sckf {

/// What it tells of the options, and of arguments without one, which have their places and are not shown: by name, and
/// what each becomes when the options are notified. Throws boost::program_options::error.
inline boost::program_options::variables_map parseCommandLine(
    int argc, char** argv, const boost::program_options::options_description& shown,
    const std::vector<std::pair<const char*, std::string*>>& in_place) {
  namespace po = boost::program_options;
  po::options_description all(shown);
  po::positional_options_description places;
  for (const auto& [name, target] : in_place) {
    all.add_options()(name, po::value(target));
    places.add(name, 1);
  }
  po::variables_map values;
  po::store(po::command_line_parser(argc, argv).options(all).positional(places).run(), values);
  return values;
}

}  // namespace sckf
