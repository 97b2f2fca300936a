// What a release says of itself in several places agrees with the place where it is decided.

#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rotslam {
namespace {

std::string Text(const std::string& file) {
  std::ifstream stream(std::filesystem::path(ROTSLAM_SOURCE_DIR) / file);
  EXPECT_TRUE(stream) << file;
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

// The first group of the first match.
std::string Find(const std::string& file, const std::string& pattern) {
  const std::string text = Text(file);
  std::smatch match;
  if (!std::regex_search(text, match, std::regex(pattern))) {
    ADD_FAILURE() << file << " has nothing like " << pattern;
    return "";
  }
  return match[1];
}

// CMake's project has the version; all others repeat it.
TEST(Release, HasOneVersion) {
  const std::string version = Find("CMakeLists.txt", R"(project\(rotslam VERSION ([0-9.]+))");
  EXPECT_EQ(Find("CITATION.cff", R"(\nversion: (\S+))"), version);
  EXPECT_EQ(Find("CHANGELOG.md", R"(\n## \[([0-9.]+)\] - )"), version);
}

TEST(Release, IsDatedAlike) {
  EXPECT_EQ(Find("CITATION.cff", R"(\ndate-released: (\S+))"),
            Find("CHANGELOG.md", R"(\n## \[[0-9.]+\] - (\d{4}-\d\d-\d\d)\n)"));
}

TEST(Release, FormatsAreDocumentedWithTheirNumbers) {
  const std::string document = Text("docs/formats.md");
  for (const char* file : {"output/map/run_map.cc",
                           "output/map/thumbnails_file.cc",
                           "output/map/view_graph_matches.cc",
                           "apps/cli/run_directory/checkpoint.cc"}) {
    const std::string magic = Find(file, R"re(k\w*Magic = "(rotslam\w* ?\w* [0-9]+)\\n";)re");
    EXPECT_THAT(document, testing::HasSubstr("`" + magic + "`")) << file;
  }
}

}  // namespace
}  // namespace rotslam
