#include "apps/cli/input/config.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <string_view>
#include <type_traits>
#include <utility>

#include <yaml-cpp/yaml.h>

#include "apps/cli/input/former_options.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

// Insertions, deletions and replacements that turn `a` into `b` (Levenshtein).
std::size_t EditDistance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

std::string LastPart(const std::string& key) { return key.substr(key.rfind('.') + 1); }

// Right name in the wrong group is one step more than right name, whatever the group is called.
// Among equally near names comes first the one in the most similar group.
std::pair<std::size_t, std::size_t> KeyDistance(const std::string& key, const std::string& known) {
  const std::size_t whole = EditDistance(key, known);
  return {std::min(whole, EditDistance(LastPart(key), LastPart(known)) + 1), whole};
}

// What OverrideOptions knows about its keys: options, and the groups they lie in.
struct KnownKeys {
  std::map<std::string, const OptionRef*> option_of;
  std::set<std::string> groups;
  std::vector<std::string> keys;  // of the options, in their order

  explicit KnownKeys(const std::vector<OptionRef>& options) {
    for (const OptionRef& option : options) {
      option_of[option.key] = &option;
      keys.push_back(option.key);
      for (std::size_t dot = option.key.find('.'); dot != std::string::npos;
           dot = option.key.find('.', dot + 1)) {
        groups.insert(option.key.substr(0, dot));
      }
    }
  }

  std::string Nearest(const std::string& whole_key) const {
    // No option is that long, and the time goes with the length.
    const std::string key = whole_key.substr(0, 100);
    std::vector<std::string> candidates = keys;
    candidates.insert(candidates.end(), groups.begin(), groups.end());
    std::string nearest;
    std::pair least(std::numeric_limits<std::size_t>::max(), std::size_t{0});
    for (const std::string& candidate : candidates) {
      const std::pair distance = KeyDistance(key, candidate);
      if (distance >= least) continue;
      nearest = candidate;
      least = distance;
    }
    return nearest;
  }

  std::string Unknown(const std::string& key) const {
    if (std::string former = FormerOption(key); !former.empty()) return former;
    const std::string nearest = Nearest(key);
    return "no option is called \"" + key + "\"" +
           (nearest.empty() ? "" : "; the nearest one is \"" + nearest + "\"");
  }
};

std::string Shown(const YAML::Node& node) {
  if (node.IsNull()) return "nothing";
  if (node.IsSequence()) return "a list";
  if (node.IsMap()) return "a map";
  return "\"" + node.Scalar() + "\"";
}

template <class Field>
std::string Expected(const Field*) {
  if constexpr (std::is_same_v<Field, bool>) return "true or false";
  if constexpr (std::is_same_v<Field, int>) return "a whole number";
  if constexpr (std::is_same_v<Field, std::uint64_t>) return "a whole number from 0";
  if constexpr (std::is_same_v<Field, double>) return "a number";
  return "text";
}

std::string Expected(const ChoiceField& choice) { return choice.AllWords(); }

template <class Field>
bool Assign(const YAML::Node& node, Field* field) {
  if (!node.IsScalar()) return false;
  if constexpr (std::is_unsigned_v<Field> && !std::is_same_v<Field, bool>) {
    if (node.Scalar().starts_with('-')) return false;
  }
  Field value;
  if (!YAML::convert<Field>::decode(node, value)) return false;
  if constexpr (std::is_same_v<Field, double>) {
    if (std::isnan(value)) return false;
  }
  *field = std::move(value);
  return true;
}

bool Assign(const YAML::Node& node, const ChoiceField& choice) {
  return node.IsScalar() && choice.Assign(node.Scalar());
}

class Loader {
 public:
  Loader(const std::filesystem::path& path, const KnownKeys& vocabulary)
      : path_(path), vocabulary_(vocabulary) {}

  void LoadGroup(const YAML::Node& map, const std::string& group) const {
    std::set<std::string> seen;
    for (const auto& entry : map) {
      if (!entry.first.IsScalar()) Refuse(entry.first, "an option's name cannot be a list or map");
      const std::string key =
          group.empty() ? entry.first.Scalar() : group + "." + entry.first.Scalar();
      if (!seen.insert(key).second) Refuse(entry.first, "\"" + key + "\" stands here twice");
      LoadEntry(entry.first, entry.second, key);
    }
  }

  [[noreturn]] void Refuse(const YAML::Node& node, const std::string& reason) const {
    throw std::runtime_error(AtLine(path_, node.Mark().line + 1, reason));
  }

 private:
  void LoadEntry(const YAML::Node& name, const YAML::Node& value, const std::string& key) const {
    if (vocabulary_.groups.contains(key)) {
      if (value.IsNull()) return;
      if (!value.IsMap()) {
        Refuse(name, "\"" + key + "\" is a group of options, found " + Shown(value));
      }
      LoadGroup(value, key);
      return;
    }
    const auto option = vocabulary_.option_of.find(key);
    if (option == vocabulary_.option_of.end()) {
      Refuse(name, vocabulary_.Unknown(key));
    }
    std::visit(
        [&](const auto& field) {
          if (!Assign(value, field)) {
            Refuse(name, "\"" + key + "\" expects " + Expected(field) + ", found " + Shown(value));
          }
        },
        option->second->field);
  }

  const std::filesystem::path& path_;
  const KnownKeys& vocabulary_;
};

}  // namespace

YAML::Node ReadYaml(const std::filesystem::path& path, const std::string& what) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    throw std::runtime_error(path.string() + ": is a folder, not the " + what);
  }
  try {
    return YAML::LoadFile(path.string());
  } catch (const YAML::BadFile&) {
    throw std::runtime_error(path.string() + ": cannot read the " + what);
  } catch (const YAML::ParserException& error) {
    throw std::runtime_error(AtLine(path, error.mark.line + 1, "not YAML: " + error.msg));
  }
}

std::string UnknownOption(const std::string& key, const std::vector<OptionRef>& options) {
  return KnownKeys(options).Unknown(key);
}

void OverrideOptions(const std::filesystem::path& path, const std::vector<OptionRef>& options) {
  OverrideOptions(path, ReadYaml(path, "options file"), options);
}

void OverrideOptions(const std::filesystem::path& path,
                     const YAML::Node& map,
                     const std::vector<OptionRef>& options) {
  if (!map.IsDefined() || map.IsNull()) return;
  const KnownKeys vocabulary(options);
  const Loader loader(path, vocabulary);
  if (!map.IsMap()) loader.Refuse(map, "expected options as `name: value`");
  loader.LoadGroup(map, "");
}

}  // namespace rotslam
