#pragma once

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "output/files/option_list.h"

namespace YAML {
class Node;
}

namespace rotslam {

/// The content of a YAML file. Throws std::runtime_error with file and reason: not there, a folder,
/// not YAML. `what` says what the file should be ("options file").
YAML::Node ReadYaml(const std::filesystem::path& path, const std::string& what);

/// 'no option is called "matching.radius"; the nearest one is "matching.radius_px"', or what became
/// of a former option (FormerOption).
std::string UnknownOption(const std::string& key, const std::vector<OptionRef>& options);

/// Overrides the listed options by a YAML file whose maps are the options' groups:
/// `matching: {max_distance: 60}` sets "matching.max_distance". The file may be empty.
/// Throws std::runtime_error with file, line and reason: not YAML, a key that no option has (names
/// the nearest one), a key twice, a value of another type than its option.
void OverrideOptions(const std::filesystem::path& path, const std::vector<OptionRef>& options);

/// The same with a part of the file at `path` that has been read already.
void OverrideOptions(const std::filesystem::path& path,
                     const YAML::Node& map,
                     const std::vector<OptionRef>& options);

/// The same for an options struct, whose `Problem()` is then asked and reported likewise.
template <class Options>
void LoadOptionsYaml(const std::filesystem::path& path, Options& options) {
  OverrideOptions(path, ListOptions(options));
  if (const std::optional<std::string> problem = options.Problem()) {
    throw std::runtime_error(path.string() + ": " + *problem);
  }
}

}  // namespace rotslam
