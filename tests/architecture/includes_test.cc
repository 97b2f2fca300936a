#include <algorithm>
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
                                    "rotodom/masks",
                                    "rotodom/features",
                                    "rotodom/matching",
                                    "rotodom/relative_rotation",
                                    "rotodom/rolling_shutter",
                                    "rotodom/motion_blur"};
// What applications call.
const std::set<Folder> kLibraries = {"rotodom/types",
                                     "rotodom/camera",
                                     "rotodom/sequence",
                                     "rotodom/masks",
                                     "rotodom/features",
                                     "rotodom/matching",
                                     "rotodom/relative_rotation",
                                     "rotodom/rolling_shutter",
                                     "rotodom/motion_blur",
                                     "rotodom/tracking",
                                     "rotodom/track_completion",
                                     "rotodom/tracks",
                                     "rotodom/view_graph",
                                     "rotodom/averaging",
                                     "rotodom/averaging/support",
                                     "rotodom/sensor_orientations",
                                     "rotodom",
                                     "rotodom/loop",
                                     "rotodom/self_calibration",
                                     "krot",
                                     "ba"};
const std::set<Folder> kOutput = {"output/files",
                                  "output/trajectory",
                                  "output/graph",
                                  "output/map",
                                  "output/tables",
                                  "output/export"};
const std::set<Folder> kOutputBase = {"rotodom/types", "rotodom/camera", "output/files"};

std::set<Folder> With(std::set<Folder> folders, const std::set<Folder>& more) {
  folders.insert(more.begin(), more.end());
  return folders;
}

const std::map<Folder, std::set<Folder>> kAllowed = {
    {"rotodom/types", {}},
    {"rotodom/simd", {}},
    {"rotodom/camera", {"rotodom/types"}},
    {"rotodom/camera/forms", {"rotodom/types", "rotodom/camera"}},
    {"rotodom/sequence", {"rotodom/types", "rotodom/camera"}},
    {"rotodom/sequence/bag", {"rotodom/types", "rotodom/camera", "rotodom/sequence"}},
    {"rotodom/sequence/video", {"rotodom/types", "rotodom/camera", "rotodom/sequence"}},
    {"rotodom/sequence/forms",
     {"rotodom/types",
      "rotodom/camera",
      "rotodom/sequence",
      "rotodom/sequence/bag",
      "rotodom/sequence/video"}},
    {"rotodom/masks", {"rotodom/types"}},
    {"rotodom/features", {"rotodom/types", "rotodom/simd", "rotodom/camera", "rotodom/masks"}},
    {"rotodom/matching", {"rotodom/types", "rotodom/simd", "rotodom/camera", "rotodom/features"}},
    {"rotodom/relative_rotation", {"rotodom/types", "rotodom/simd"}},
    {"rotodom/averaging", {"rotodom/types"}},
    {"rotodom/averaging/support", {"rotodom/types", "rotodom/averaging"}},
    {"rotodom/sensor_orientations", {"rotodom/types"}},
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
      "rotodom/masks",
      "rotodom/features",
      "rotodom/matching",
      "rotodom/rolling_shutter",
      "rotodom/motion_blur"}},
    {"rotodom/view_graph",
     {"rotodom/types",
      "rotodom/camera",
      "rotodom/features",
      "rotodom/relative_rotation",
      "rotodom/tracks"}},
    {"rotodom", With(kFrontEnd, {"rotodom/averaging", "rotodom/tracking", "rotodom/view_graph"})},
    {"rotodom/loop",
     With(kFrontEnd, {"rotodom/averaging", "rotodom/tracking", "rotodom/view_graph", "rotodom"})},
    {"rotodom/self_calibration",
     {"rotodom/types",
      "rotodom/camera",
      "rotodom/features",
      "rotodom/relative_rotation",
      "rotodom/averaging",
      "rotodom/view_graph",
      "rotodom"}},
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
    {"ba/types", {"rotodom/types", "rotodom/camera"}},
    {"ba/cost", {"rotodom/types", "rotodom/camera", "ba/types"}},
    {"ba/problem", {"rotodom/types", "rotodom/camera", "ba/types", "ba/cost"}},
    {"ba/outliers", {"rotodom/types", "rotodom/camera", "ba/types", "ba/cost", "ba/problem"}},
    {"ba/solver", {"rotodom/types", "rotodom/camera", "ba/types", "ba/cost", "ba/problem"}},
    {"ba/covariance", {"rotodom/types", "rotodom/camera", "ba/types", "ba/cost", "ba/problem"}},
    {"ba/zoom", {"rotodom/types", "rotodom/camera", "ba", "ba/cost"}},
    {"ba",
     {"rotodom/types",
      "rotodom/camera",
      "ba/types",
      "ba/cost",
      "ba/problem",
      "ba/outliers",
      "ba/solver",
      "ba/covariance"}},
    {"output/files", {"rotodom/types"}},
    {"output/trajectory", {"rotodom/types", "output/files"}},
    {"output/trajectory/forms", {"rotodom/types", "output/files", "output/trajectory"}},
    {"output/graph", {"rotodom/types", "output/files", "output/trajectory"}},
    {"output/graph/forms", {"rotodom/types", "output/files", "output/trajectory", "output/graph"}},
    {"output/map", kOutputBase},
    {"output/tables", With(kOutputBase, {"output/trajectory"})},
    {"output/export", With(kOutputBase, {"output/trajectory", "output/map"})},
    // The mapping library reads no files of ours, writes none and knows no command line.
    {"apps/slam/map", kLibraries},
    {"apps/slam/map_correction", With(kLibraries, {"apps/slam/map"})},
    {"apps/slam/working_size", kLibraries},
    {"apps/slam/masks", With(kLibraries, {"apps/slam/working_size"})},
    {"apps/slam/zoom", With(kLibraries, {"ba/zoom"})},
    {"apps/slam/input",
     With(kLibraries, {"apps/slam/map", "apps/slam/masks", "apps/slam/working_size"})},
    {"apps/slam",
     With(kLibraries,
          {"apps/slam/input",
           "apps/slam/map",
           "apps/slam/map_correction",
           "apps/slam/masks",
           "apps/slam/working_size",
           "apps/slam/zoom",
           "ba/zoom"})},
    {"apps/slam/live",
     With(kLibraries,
          {"krot/initialisation",
           "ba/cost",
           "apps/slam",
           "apps/slam/input",
           "apps/slam/map",
           "apps/slam/masks",
           "apps/slam/working_size"})},
    {"apps/simulation", {"rotodom/types", "rotodom/camera"}},
    {"apps/paper_method",
     {"rotodom/types",
      "rotodom/camera",
      "rotodom/features",
      "rotodom/matching",
      "rotodom/relative_rotation",
      "rotodom/averaging",
      "rotodom",
      "rotodom/loop"}},
    // What the pages of other rooms share.
    {"apps/page", {"rotodom/types"}},
    {"apps/report",
     With(kOutput, {"rotodom/types", "rotodom/camera", "rotodom/sequence", "apps/page"})},
    {"apps/report/figures",
     With(kOutput, {"rotodom/types", "rotodom/camera", "apps/page", "apps/report"})},
    {"apps/live_view",
     {"rotodom/types", "rotodom/camera", "apps/slam", "apps/slam/live", "apps/page"}},
    {"apps/cli/terminal",
     With(kLibraries,
          {"apps/slam",
           "apps/slam/map",
           "apps/slam/working_size",
           "apps/slam/zoom",
           "output/files"})},
    {"apps/cli", {"apps/cli/terminal", "output/tables"}},
    {"apps/cli/input",
     With(With(kLibraries, kOutput),
          {"apps/slam", "apps/slam/input", "apps/slam/masks", "apps/cli/terminal"})},
    {"apps/cli/live",
     With(With(kLibraries, kOutput),
          {"apps/slam", "apps/slam/live", "apps/live_view", "apps/cli/terminal"})},
    {"apps/cli/run_directory",
     With(With(kLibraries, kOutput),
          {"apps/slam",
           "apps/slam/input",
           "apps/slam/masks",
           "apps/slam/zoom",
           "apps/cli",
           "apps/cli/terminal",
           "apps/cli/input"})},
    {"apps/cli/export",
     With(With(kLibraries, kOutput),
          {"apps/report", "apps/cli/terminal", "apps/cli/input", "apps/cli/run_directory"})},
    {"apps/cli/solve",
     With(With(kLibraries, kOutput),
          {"apps/slam",
           "apps/slam/map",
           "apps/slam/working_size",
           "apps/cli/terminal",
           "apps/cli/input"})},
    {"apps/cli/paper",
     With(kLibraries,
          {"apps/paper_method",
           "apps/slam",
           "apps/slam/input",
           "apps/cli/terminal",
           "apps/cli/input"})},
    {"apps/batch", With(With(kLibraries, kOutput), {"apps/report", "apps/cli/input"})},
    {"apps/cli/commands",
     With(With(kLibraries, kOutput),
          {"apps/slam",
           "apps/slam/input",
           "apps/slam/live",
           "apps/slam/map",
           "apps/slam/masks",
           "apps/slam/working_size",
           "apps/cli/live",
           "apps/cli/paper",
           "apps/simulation",
           "apps/report",
           "apps/report/figures",
           "apps/batch",
           "apps/cli",
           "apps/cli/terminal",
           "apps/cli/input",
           "apps/cli/run_directory",
           "apps/cli/export",
           "apps/cli/solve"})},
    {"apps/python",
     With(With(kLibraries, kOutput),
          {"apps/slam", "apps/slam/input", "apps/slam/live", "apps/cli/input"})},
};

// Examples use what is installed.
const std::string kExamples = "apps/examples/";
const std::set<Folder> kInstalled =
    With(With(kLibraries, kOutput), {"apps/slam", "apps/slam/input", "apps/slam/live"});

// What a folder may include; null where nobody has decided it.
const std::set<Folder>* AllowedFrom(const Folder& folder) {
  if (folder.starts_with(kExamples)) return &kInstalled;
  const auto allowed = kAllowed.find(folder);
  return allowed == kAllowed.end() ? nullptr : &allowed->second;
}

// A room that nobody can take in at a glance is split: .h and .cc files, not those of rooms within.
constexpr int kMaxFiles = 25;

// These build and test without OpenCV.
bool DoesWithoutOpenCv(const Folder& folder) {
  return folder == "rotodom/types" || folder.starts_with("rotodom/camera") ||
         folder.starts_with("krot") || folder.starts_with("ba") || folder.starts_with("output");
}

using File = std::filesystem::path;  // from the project's folder on

struct Include {
  File file;           // that has the line
  std::string target;  // as written, without quotes or brackets
  bool quoted = false;

  Folder From() const { return file.parent_path().string(); }
};

// All .h and .cc files of the program.
std::vector<File> SourceFiles() {
  const std::filesystem::path root = ROTSLAM_SOURCE_DIR;
  std::vector<File> files;
  for (const char* top : {"rotodom", "krot", "ba", "output", "apps"}) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root / top)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".h" && extension != ".cc") continue;
      files.push_back(std::filesystem::relative(entry.path(), root));
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<Include> IncludesOf(const File& file) {
  static const std::regex kPattern(R"re(^\s*#\s*include\s*(["<])([^">]+)[">])re");
  std::vector<Include> includes;
  std::ifstream stream(std::filesystem::path(ROTSLAM_SOURCE_DIR) / file);
  for (std::string line; std::getline(stream, line);) {
    std::smatch match;
    if (!std::regex_search(line, match, kPattern)) continue;
    includes.push_back({file, match[2].str(), match[1] == "\""});
  }
  return includes;
}

std::vector<Include> AllIncludes() {
  std::vector<Include> includes;
  for (const File& file : SourceFiles()) {
    const std::vector<Include> more = IncludesOf(file);
    includes.insert(includes.end(), more.begin(), more.end());
  }
  return includes;
}

// A header and its source, by their path without extension.
using Module = std::string;

Module ModuleOf(File file) { return file.replace_extension().string(); }

// Which modules include which, as circles are looked for in it.
class ModuleGraph {
 public:
  explicit ModuleGraph(const std::vector<Include>& includes) {
    for (const Include& include : includes) {
      if (!include.quoted) continue;
      const Module from = ModuleOf(include.file);
      const Module to = ModuleOf(include.target);
      if (from != to) below_[from].insert(to);
    }
  }

  // Each as "a -> b -> a"; none where there are none. Of circles that share modules one is enough.
  std::vector<std::string> Circles() {
    for (const auto& [module, below] : below_) Visit(module);
    return circles_;
  }

 private:
  void Visit(const Module& module) {
    if (done_.contains(module)) return;
    const auto begin = std::find(path_.begin(), path_.end(), module);
    if (begin != path_.end()) {
      std::string circle;
      for (auto step = begin; step != path_.end(); ++step) circle += *step + " -> ";
      circles_.push_back(circle + module);
      return;
    }
    path_.push_back(module);
    for (const Module& below : below_[module]) Visit(below);
    path_.pop_back();
    done_.insert(module);
  }

  std::map<Module, std::set<Module>> below_;
  std::set<Module> done_;
  std::vector<Module> path_;  // that is being followed
  std::vector<std::string> circles_;
};

TEST(Architecture, KnowsEveryFolder) {
  std::set<Folder> folders;
  for (const File& file : SourceFiles()) folders.insert(file.parent_path().string());
  for (const Folder& folder : folders) {
    EXPECT_NE(AllowedFrom(folder), nullptr)
        << folder << " is new: say in kAllowed what it may include";
  }
  for (const auto& [folder, allowed] : kAllowed) {
    EXPECT_TRUE(folders.contains(folder)) << folder << " has gone: take it from kAllowed";
  }
}

TEST(Architecture, HasNoNewArrowBetweenFolders) {
  int num_arrows = 0;
  for (const Include& include : AllIncludes()) {
    if (!include.quoted) continue;
    const Folder from = include.From();
    const Folder to = std::filesystem::path(include.target).parent_path().string();
    EXPECT_FALSE(to.empty()) << include.file << " includes \"" << include.target
                             << "\": includes carry the folder";
    if (to == from) continue;
    ++num_arrows;
    const std::set<Folder>* const allowed = AllowedFrom(from);
    EXPECT_TRUE(allowed != nullptr && allowed->contains(to))
        << include.file << " draws a new arrow: " << from << " -> " << to;
  }
  EXPECT_GT(num_arrows, 10) << "found no includes: is the source folder right?";
}

TEST(Architecture, HasNoCircleOfModules) {
  for (const std::string& circle : ModuleGraph(AllIncludes()).Circles()) {
    ADD_FAILURE() << "these include one another: " << circle;
  }
}

TEST(Architecture, FindsCircles) {
  const auto circles = ModuleGraph({{"krot/a.h", "krot/b.h", true},
                                    {"krot/b.h", "ba/d.h", true},
                                    {"krot/b.cc", "krot/b.h", true},
                                    {"krot/b.cc", "krot/c.h", true},
                                    {"krot/c.h", "krot/b.h", true},
                                    {"krot/d.h", "krot/a.h", true}})
                           .Circles();
  ASSERT_EQ(circles.size(), 1U);
  EXPECT_EQ(circles.front(), "krot/b -> krot/c -> krot/b");
}

TEST(Architecture, KeepsRoomsSmall) {
  std::map<Folder, int> num_files;
  for (const File& file : SourceFiles()) ++num_files[file.parent_path().string()];
  for (const auto& [folder, count] : num_files) {
    EXPECT_LE(count, kMaxFiles) << folder << " has too many files: split it";
  }
}

TEST(Architecture, KeepsOpenCvInTheFrontEnd) {
  for (const Include& include : AllIncludes()) {
    if (!DoesWithoutOpenCv(include.From())) continue;
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
