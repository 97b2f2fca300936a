#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

using Folder = std::string;

// Who may include whom. Arrows point down only; a new one is a decision, and is made here.
const std::set<Folder> kFrontEnd = {"rotodom/types",
                                    "rotodom/camera",
                                    "rotodom/features",
                                    "rotodom/matching",
                                    "rotodom/relative_rotation",
                                    "rotodom/rolling_shutter",
                                    "rotodom/motion_blur"};
const std::set<Folder> kOutputBase = {"rotodom/types", "rotodom/camera", "output/files"};

std::set<Folder> With(std::set<Folder> folders, const std::set<Folder>& more) {
  folders.insert(more.begin(), more.end());
  return folders;
}

const std::map<Folder, std::set<Folder>> kAllowed = {
    {"rotodom/types", {}},
    {"rotodom/camera", {"rotodom/types"}},
    {"rotodom/camera/forms", {"rotodom/types", "rotodom/camera"}},
    {"rotodom/sequence", {"rotodom/types", "rotodom/camera"}},
    {"rotodom/sequence/bag", {"rotodom/types", "rotodom/camera", "rotodom/sequence"}},
    {"rotodom/sequence/forms",
     {"rotodom/types", "rotodom/camera", "rotodom/sequence", "rotodom/sequence/bag"}},
    {"rotodom/features", {"rotodom/types", "rotodom/camera"}},
    {"rotodom/matching", {"rotodom/types", "rotodom/camera", "rotodom/features"}},
    {"rotodom/relative_rotation", {"rotodom/types"}},
    {"rotodom/averaging", {"rotodom/types"}},
    {"rotodom/tracks", {"rotodom/types", "rotodom/features"}},
    {"rotodom/rolling_shutter",
     {"rotodom/types", "rotodom/camera", "rotodom/features", "rotodom/relative_rotation"}},
    {"rotodom/motion_blur",
     {"rotodom/types",
      "rotodom/camera",
      "rotodom/features",
      "rotodom/matching",
      "rotodom/rolling_shutter"}},
    {"rotodom/tracking", kFrontEnd},
    {"rotodom/track_completion",
     {"rotodom/types",
      "rotodom/camera",
      "rotodom/features",
      "rotodom/matching",
      "rotodom/rolling_shutter",
      "rotodom/motion_blur"}},
    {"rotodom/view_graph",
     {"rotodom/types", "rotodom/features", "rotodom/relative_rotation", "rotodom/tracks"}},
    {"rotodom", With(kFrontEnd, {"rotodom/averaging", "rotodom/tracking", "rotodom/view_graph"})},
    {"rotodom/loop",
     With(kFrontEnd, {"rotodom/averaging", "rotodom/tracking", "rotodom/view_graph", "rotodom"})},
    {"krot/lp", {"rotodom/types"}},
    {"krot/structure", {"rotodom/types", "krot/lp"}},
    {"krot/interior_point", {"rotodom/types", "krot/lp", "krot/structure"}},
    {"krot/bracket", {"rotodom/types", "krot/lp", "krot/structure", "krot/interior_point"}},
    {"krot/initialisation", {"rotodom/types", "krot/lp", "krot/structure", "krot/interior_point"}},
    {"krot",
     {"rotodom/types",
      "rotodom/camera",
      "krot/lp",
      "krot/structure",
      "krot/interior_point",
      "krot/bracket",
      "krot/initialisation"}},
    {"ba", {"rotodom/types", "rotodom/camera"}},
    {"output/files", {"rotodom/types"}},
    {"output/trajectory", {"rotodom/types", "output/files"}},
    {"output/trajectory/forms", {"rotodom/types", "output/files", "output/trajectory"}},
    {"output/graph", {"rotodom/types", "output/files", "output/trajectory"}},
    {"output/graph/forms", {"rotodom/types", "output/files", "output/trajectory", "output/graph"}},
    {"output/map", kOutputBase},
    {"output/tables", With(kOutputBase, {"output/trajectory"})},
    {"output/export", With(kOutputBase, {"output/trajectory", "output/map"})},
};

// Folders at the top, which may include everything below them and which nothing below includes.
const std::string kTop = "apps";

// These build and test without OpenCV.
bool DoesWithoutOpenCv(const Folder& folder) {
  return folder == "rotodom/types" || folder.starts_with("rotodom/camera") ||
         folder.starts_with("krot") || folder == "ba" || folder.starts_with("output");
}

struct Include {
  Folder from;
  std::string file;    // that has the line
  std::string target;  // as written, without quotes or brackets
  bool quoted = false;
};

bool IsTop(const Folder& folder) { return folder == kTop || folder.starts_with(kTop + "/"); }

std::vector<Include> IncludesOf(const std::filesystem::path& root, const std::string& top_folder) {
  static const std::regex kPattern(R"re(^\s*#\s*include\s*(["<])([^">]+)[">])re");
  std::vector<Include> includes;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(root / top_folder)) {
    const std::string extension = entry.path().extension().string();
    if (extension != ".h" && extension != ".cc") continue;
    const std::filesystem::path file = std::filesystem::relative(entry.path(), root);
    std::ifstream stream(entry.path());
    for (std::string line; std::getline(stream, line);) {
      std::smatch match;
      if (!std::regex_search(line, match, kPattern)) continue;
      includes.push_back(
          {file.parent_path().string(), file.string(), match[2].str(), match[1] == "\""});
    }
  }
  return includes;
}

std::vector<Include> AllIncludes() {
  std::vector<Include> includes;
  for (const char* folder : {"rotodom", "krot", "ba", "output", "apps"}) {
    const std::vector<Include> more = IncludesOf(ROTSLAM_SOURCE_DIR, folder);
    includes.insert(includes.end(), more.begin(), more.end());
  }
  return includes;
}

TEST(Architecture, HasNoNewArrowBetweenFolders) {
  int num_arrows = 0;
  for (const Include& include : AllIncludes()) {
    if (!include.quoted) continue;
    const Folder to = std::filesystem::path(include.target).parent_path().string();
    EXPECT_FALSE(to.empty()) << include.file << " includes \"" << include.target
                             << "\": includes carry the folder";
    if (to == include.from) continue;
    ++num_arrows;
    if (IsTop(include.from)) continue;
    const auto allowed = kAllowed.find(include.from);
    const bool known = allowed != kAllowed.end() && allowed->second.contains(to);
    EXPECT_TRUE(known) << include.file << " draws a new arrow: " << include.from << " -> " << to;
  }
  EXPECT_GT(num_arrows, 10) << "found no includes: is the source folder right?";
}

TEST(Architecture, KeepsOpenCvInTheFrontEnd) {
  for (const Include& include : AllIncludes()) {
    if (!DoesWithoutOpenCv(include.from)) continue;
    EXPECT_FALSE(include.target.starts_with("opencv")) << include.file << " includes OpenCV";
  }
}

TEST(Architecture, ListHasNoCircles) {
  // Folders leave the list when all they include has left; a circle never does.
  std::map<Folder, std::set<Folder>> left = kAllowed;
  for (bool removed = true; removed;) {
    removed = false;
    for (auto entry = left.begin(); entry != left.end();) {
      bool free = true;
      for (const Folder& below : entry->second) free = free && !left.contains(below);
      removed = removed || free;
      entry = free ? left.erase(entry) : std::next(entry);
    }
  }
  for (const auto& [folder, below] : left) ADD_FAILURE() << folder << " is part of a circle";
}

}  // namespace
}  // namespace rotslam
