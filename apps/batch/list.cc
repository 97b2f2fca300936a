#include "apps/batch/list.h"

#include <algorithm>
#include <optional>
#include <set>
#include <stdexcept>

#include <yaml-cpp/yaml.h>

#include "apps/cli/input/config.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

class ListReader {
 public:
  ListReader(const fs::path& path, const std::string& config) : path_(path), config_(config) {}

  BatchEntry ReadEntry(const YAML::Node& node) const {
    if (!node.IsMap()) Refuse(node, "expected a sequence as `path: ..`");
    BatchEntry entry;
    OverrideOptions(path_, node, ListOptions(entry));
    const std::string config = entry.config.empty() ? config_ : FromList(entry.config);
    if (!config.empty()) {
      LoadOptionsYaml(config, entry.options);
      OverrideOptions(path_, node, ListOptions(entry));
    }
    if (const auto problem = entry.options.Problem()) Refuse(node, *problem);
    if (entry.path.empty()) Refuse(node, "no `path` of a sequence");
    for (std::string* file : {&entry.path,
                              &entry.camera,
                              &entry.ground_truth,
                              &entry.times,
                              &entry.rotations,
                              &entry.vocabulary,
                              &entry.config}) {
      const bool is_estimated = file == &entry.camera && entry.camera == "none";
      if (!is_estimated) *file = FromList(*file);
    }
    Check(node, entry);
    return entry;
  }

  [[noreturn]] void Refuse(const YAML::Node& node, const std::string& reason) const {
    throw std::runtime_error(AtLine(path_, node.Mark().line + 1, reason));
  }

 private:
  std::string FromList(const std::string& file) const {
    if (file.empty()) return "";
    const fs::path whole = (fs::absolute(path_).parent_path() / file).lexically_normal();
    return (whole.has_filename() ? whole : whole.parent_path()).string();
  }

  void Check(const YAML::Node& node, BatchEntry& entry) const {
    if (entry.name.empty()) entry.name = fs::path(entry.path).filename().string();
    const auto is_plain = [](char c) {
      return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
             c == '.' || c == '_' || c == '-';
    };
    if (!std::all_of(entry.name.begin(), entry.name.end(), is_plain) ||
        entry.name.starts_with('.') || entry.name.starts_with('-')) {
      Refuse(node,
             "\"" + entry.name +
                 "\" cannot name a folder of results: give a `name` of a-z, A-Z, 0-9, '.', '_' "
                 "and '-' that begins with a letter or digit");
    }
    if (entry.command != "run" && entry.command != "rotations") {
      Refuse(node, "\"command\" is \"" + entry.command + "\", must be run or rotations");
    }
    if (entry.command == "rotations" && !entry.rotations.empty()) {
      Refuse(node, "\"rotations\" goes with `command: run` only");
    }
    if (entry.align && entry.rotations.empty()) {
      Refuse(node, "\"align\" goes with \"rotations\" only");
    }
  }

  const fs::path& path_;
  const std::string& config_;
};

}  // namespace

std::vector<BatchEntry> ReadBatchList(const fs::path& path, const std::string& config) {
  const YAML::Node root = ReadYaml(path, "list of sequences");
  const ListReader reader(path, config);
  if (!root.IsSequence() || root.size() == 0) {
    reader.Refuse(root, "expected a list of sequences, each `- path: ..`");
  }
  std::vector<BatchEntry> entries;
  entries.reserve(root.size());
  std::set<std::string> names;
  for (const YAML::Node& node : root) {
    entries.push_back(reader.ReadEntry(node));
    if (!names.insert(entries.back().name).second) {
      reader.Refuse(node, "the name \"" + entries.back().name + "\" is taken; give another `name`");
    }
  }
  return entries;
}

}  // namespace rotslam
