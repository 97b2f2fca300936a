// The options of a run: that there are few, what they say, and the documentation made from them.

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "tests/apps/command_line.h"

namespace rotslam {
namespace {

using testing::HasSubstr;

namespace fs = std::filesystem;

// The lines of options, without those of groups.
std::vector<std::string> OptionLines(const std::string& yaml) {
  std::vector<std::string> lines = Lines(yaml);
  std::erase_if(lines, [](const std::string& line) { return line.empty() || line.ends_with(':'); });
  return lines;
}

std::string PrintedConfig(const std::vector<std::string>& more = {}) {
  std::vector<std::string> arguments = {"run", "--print-config"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  const CommandResult result = Rotslam(arguments);
  EXPECT_EQ(result.exit_code, 0) << result.error;
  EXPECT_EQ(result.error, "");
  return result.output;
}

TEST(PrintConfig, HasAtMostEightyOptionsEachWithItsText) {
  const std::vector<std::string> lines = OptionLines(PrintedConfig());
  EXPECT_GE(lines.size(), 50U);
  EXPECT_LE(lines.size(), 80U);
  for (const std::string& line : lines) {
    EXPECT_THAT(line, testing::ContainsRegex("^ *[a-z0-9_]+: [^ ]+ +# [^ ].*[^ .]$"));
    EXPECT_LE(line.size(), 120U) << line;
  }
}

TEST(PrintConfig, IsWhatConfigTakes) {
  const TemporaryFolder folder;
  const std::string defaults = PrintedConfig();
  const std::string all = folder.Write("all.yaml", defaults).string();
  EXPECT_EQ(PrintedConfig({"--config", all}), defaults);
  const std::string some = folder.Write("some.yaml", "loop: {use_loops: false}\n").string();
  const YAML::Node printed =
      YAML::Load(PrintedConfig({"--config", some, "--stride=3", "--krot=bisection"}));
  EXPECT_FALSE(printed["loop"]["use_loops"].as<bool>());
  EXPECT_EQ(printed["sequence"]["stride"].as<int>(), 3);
  EXPECT_EQ(printed["krot"]["start"].as<std::string>(), "bisection");
  const std::string former = folder.Write("former.yaml", "ba: {min_observations: 2}\n").string();
  const CommandResult refused = Rotslam({"run", "--print-config", "--config", former});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.error, HasSubstr("former.yaml:1: \"ba.min_observations\" is fixed now"));
}

TEST(PrintConfig, IsInTheDocs) {
  const fs::path file = fs::path(ROTSLAM_DOCS_DIR) / "options.md";
  const std::string yaml = PrintedConfig();
  std::string docs = ReadWholeFile(file);
  const std::string begin_mark = "```yaml\n# Defaults\n";
  ASSERT_THAT(docs, HasSubstr(begin_mark));
  const std::size_t begin = docs.find(begin_mark) + begin_mark.size();
  const std::size_t end = docs.find("```", begin);
  if (std::getenv("ROTSLAM_UPDATE_DOCS") != nullptr) {
    docs.replace(begin, end - begin, yaml);
    std::ofstream(file) << docs;
    return;
  }
  EXPECT_EQ(docs.substr(begin, end - begin), yaml) << "run options_test with ROTSLAM_UPDATE_DOCS=1";
}

// What lies in config/ names no option that has gone.
TEST(PrintConfig, TakesTheConfigurationsThatShip) {
  int count = 0;
  for (const auto& entry : fs::directory_iterator(ROTSLAM_CONFIG_DIR)) {
    if (entry.path().extension() != ".yaml") continue;
    ++count;
    PrintedConfig({"--config", entry.path().string()});
  }
  EXPECT_GE(count, 4);
}

}  // namespace
}  // namespace rotslam
