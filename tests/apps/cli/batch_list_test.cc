// What `rotslam batch` refuses, in one line, before it runs or writes anything.

#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/apps/command_line.h"

namespace rotslam {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class BatchList : public testing::Test {
 protected:
  std::string Refusal(const std::string& list, const std::vector<std::string>& more = {}) const {
    const std::string file = folder_.Write("list.yaml", list).string();
    const std::filesystem::path out = folder_.path() / "out";
    const CommandResult result = Rotslam({"batch", file, "--out", out.string()}, more);
    EXPECT_GT(result.exit_code, 0) << list;
    EXPECT_FALSE(std::filesystem::exists(out)) << list;
    EXPECT_THAT(Lines(result.error), testing::SizeIs(1)) << list;
    return result.error;
  }

  const TemporaryFolder folder_;
};

TEST_F(BatchList, NamesLineAndReason) {
  EXPECT_THAT(Refusal(""), HasSubstr("expected a list of sequences"));
  EXPECT_THAT(Refusal("path: a\n"), HasSubstr("expected a list of sequences"));
  EXPECT_THAT(Refusal("- a\n"), HasSubstr("list.yaml:1: expected a sequence"));
  EXPECT_THAT(Refusal("- path: a\n- name: b\n"), HasSubstr("list.yaml:2: no `path`"));
  EXPECT_THAT(Refusal("- path: a\n  camra: b\n"),
              AllOf(HasSubstr("list.yaml:2: "), HasSubstr("the nearest one is \"camera\"")));
  EXPECT_THAT(Refusal("- path: a\n  options: {krot: {strat: l1}}\n"),
              HasSubstr("the nearest one is \"options.krot.start\""));
  EXPECT_THAT(Refusal("- path: a\n  options: {krot: {loose_factor: 3}}\n"),
              HasSubstr("\"options.krot.loose_factor\" is fixed now"));
  EXPECT_THAT(Refusal("- path: a\n  options: {krot: {threshold_px: -1}}\n"),
              HasSubstr("krot.threshold_px is -1"));
  EXPECT_THAT(Refusal("- path: a\n  command: solve\n"), HasSubstr("must be run or rotations"));
  EXPECT_THAT(Refusal("- path: a\n  command: rotations\n  rotations: b\n"),
              HasSubstr("goes with `command: run`"));
  EXPECT_THAT(Refusal("- path: x/a\n- path: y/a\n"), HasSubstr("the name \"a\" is taken"));
  EXPECT_THAT(Refusal("- path: a\n  name: ../b\n"), HasSubstr("cannot name a folder"));
  EXPECT_THAT(Refusal("- path: a\n  name: --out\n"), HasSubstr("cannot name a folder"));
  EXPECT_THAT(Refusal("- path: a\n  name: k\u00fcche\n"), HasSubstr("a-z, A-Z, 0-9"));
  EXPECT_THAT(Refusal("- path: a\n  config: none.yaml\n"), HasSubstr("cannot read the options"));
  EXPECT_THAT(Refusal("- path: [a\n"), HasSubstr("not YAML"));
}

TEST_F(BatchList, RefusesNumbersThatItDoesNotHave) {
  EXPECT_THAT(Refusal("- path: a\n", {"--only", "2"}), HasSubstr("there is no number 2"));
  EXPECT_THAT(Refusal("- path: a\n", {"--only", "0"}), HasSubstr("--only"));
  EXPECT_THAT(Refusal("- path: a\n", {"--jobs", "0"}), HasSubstr("--jobs"));
  EXPECT_THAT(Refusal("- path: a\n", {"--collect", "--slurm", "x"}), HasSubstr("excludes"));
  EXPECT_THAT(Refusal("- path: a\n", {"--slurm-options", "--mem=8G"}), HasSubstr("--slurm"));
  EXPECT_THAT(Refusal("- path: a\n",
                      {"--slurm", (folder_.path() / "x").string(), "--slurm-options", "mem=8G"}),
              HasSubstr("expected options of sbatch"));
}

TEST_F(BatchList, OfTheDocumentIsRead) {
  const std::string text = ReadWholeFile(std::filesystem::path(ROTSLAM_DOCS_DIR) / "cluster.md");
  const std::string fence = "```yaml\n";
  const std::size_t start = text.find(fence) + fence.size();
  const std::string list =
      folder_.Write("list.yaml", text.substr(start, text.find("```", start) - start)).string();
  const std::string script = (folder_.path() / "x.sbatch").string();
  const CommandResult result =
      Rotslam({"batch", list, "--out", (folder_.path() / "out").string(), "--slurm", script});
  EXPECT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(ReadWholeFile(script), HasSubstr("--array=1-4"));
}

}  // namespace
}  // namespace rotslam
