// What explains the program: help, completion, the manual page, versions.

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/apps/command_line.h"

namespace rotslam {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ContainsRegex;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::IsSupersetOf;
using testing::Not;
using testing::StartsWith;

bool IsInstalled(const std::string& program) {
  return std::system(("command -v " + program + " >/dev/null 2>&1").c_str()) == 0;
}

// The names below "Commands:" in a help text.
std::vector<std::string> CommandsIn(const std::string& help) {
  std::vector<std::string> names;
  bool is_below = false;
  for (const std::string& line : Lines(help)) {
    if (is_below && line.starts_with("  ") && line[2] != ' ') {
      names.push_back(line.substr(2, line.find(' ', 2) - 2));
    }
    is_below = is_below || line == "Commands:";
  }
  return names;
}

TEST(Help, EveryCommandShowsAnExample) {
  const std::vector<std::string> commands = CommandsIn(Rotslam({"--help"}).output);
  EXPECT_THAT(commands, IsSupersetOf({"run", "rotations", "calibrate", "completion", "man"}));
  for (const std::string& command : commands) {
    const CommandResult help = Rotslam({command, "--help"});
    EXPECT_EQ(help.exit_code, 0);
    EXPECT_THAT(help.output, ContainsRegex("\nExample: .*rotslam " + command));
    for (const std::string& below : CommandsIn(help.output)) {
      EXPECT_THAT(Rotslam({command, below, "--help"}).output,
                  HasSubstr("\nExample: rotslam " + command + " " + below));
    }
  }
}

TEST(Version, NamesLibrariesAndCompiler) {
  const CommandResult result = Rotslam({"--version"});
  EXPECT_EQ(result.exit_code, 0);
  const std::vector<std::string> lines = Lines(result.output);
  EXPECT_THAT(lines.front(), testing::MatchesRegex("rotslam [0-9]+\\.[0-9]+\\.[0-9]+"));
  for (const std::string library :
       {"OpenCV", "Eigen", "Ceres", "CLP", "SuiteSparse", "PCL", "nlohmann_json", "SQLite"}) {
    EXPECT_THAT(lines, Contains(ContainsRegex("^  " + library + " +[0-9]+\\.[0-9]+")));
  }
  EXPECT_THAT(lines, Contains(ContainsRegex("^  compiler +(GCC|clang) [0-9]+\\.")));
}

// ---- completion

class Completion : public testing::Test {
 protected:
  void SetUp() override {
    if (!IsInstalled("bash")) GTEST_SKIP() << "needs bash";
    script_ = folder_.Write("rotslam.bash", Rotslam({"completion", "bash"}).output).string();
  }

  // What bash offers for the last of these words.
  std::vector<std::string> Offers(const std::vector<std::string>& words) const {
    std::string quoted;
    for (const std::string& word : words) quoted += " " + Quoted(word);
    const std::string output = (folder_.path() / "offers").string();
    const std::string commands = "set -u; source " + Quoted(script_) + "; COMP_WORDS=(" + quoted +
                                 "); COMP_CWORD=" + std::to_string(words.size() - 1) +
                                 "; _rotslam; printf '%s\\n' ${COMPREPLY[@]+\"${COMPREPLY[@]}\"}";
    EXPECT_EQ(
        std::system(
            ("bash -c " + Quoted(commands) + " >" + Quoted(output) + " 2>&1 || true").c_str()),
        0);
    std::vector<std::string> offers = Lines(ReadWholeFile(output));
    std::erase(offers, "");
    return offers;
  }

  const TemporaryFolder folder_;
  std::string script_;
};

TEST_F(Completion, OffersAllCommands) {
  EXPECT_THAT(Offers({"rotslam", ""}),
              testing::UnorderedElementsAreArray(CommandsIn(Rotslam({"--help"}).output)));
  EXPECT_THAT(Offers({"rotslam", "ru"}), ElementsAre("run"));
  EXPECT_THAT(Offers({"rotslam", "vocabulary", "co"}), ElementsAre("convert"));
  EXPECT_THAT(Offers({"rotslam", "--ver"}), ElementsAre("--version"));
}

TEST_F(Completion, OffersTheOptionsOfTheCommand) {
  EXPECT_THAT(Offers({"rotslam", "run", "footage", "--"}),
              IsSupersetOf({"--camera", "--out", "--no-loops", "--krot", "--help", "--log"}));
  EXPECT_THAT(Offers({"rotslam", "eval", "--"}),
              AllOf(Contains("--json"), Not(Contains("--krot"))));
  EXPECT_THAT(Offers({"rotslam", "vocabulary", "train", "--out", "x", "--str"}),
              ElementsAre("--stride"));
  // A folder called like a command is no command.
  EXPECT_THAT(Offers({"rotslam", "run", "solve", "--js"}), IsEmpty());
}

TEST_F(Completion, OffersValuesAndElseFiles) {
  EXPECT_THAT(Offers({"rotslam", "run", "--krot", ""}),
              ElementsAre("l1", "bisection", "positioning"));
  EXPECT_THAT(Offers({"rotslam", "run", "--krot", "=", "bi"}), ElementsAre("bisection"));
  EXPECT_THAT(Offers({"rotslam", "run", "--krot", "="}),
              ElementsAre("l1", "bisection", "positioning"));
  EXPECT_THAT(Offers({"rotslam", "simulate", "g"}), ElementsAre("gimbal"));
  // bash itself goes on to files where nothing is offered.
  EXPECT_THAT(Offers({"rotslam", "run", "--camera", ""}), IsEmpty());
  EXPECT_THAT(ReadWholeFile(script_), HasSubstr("complete -o default -F _rotslam rotslam\n"));
}

// ---- manual page

TEST(ManualPage, RendersWithoutWarnings) {
  if (!IsInstalled("groff")) GTEST_SKIP() << "needs groff";
  const TemporaryFolder folder;
  const std::string page = folder.Write("rotslam.1", Rotslam({"man"}).output).string();
  const std::string text = (folder.path() / "text").string();
  const std::string warnings = (folder.path() / "warnings").string();
  ASSERT_EQ(std::system(("groff -man -ww -Tutf8 -P-c -P-b -P-u " + Quoted(page) + " >" +
                         Quoted(text) + " 2>" + Quoted(warnings))
                            .c_str()),
            0);
  EXPECT_EQ(ReadWholeFile(warnings), "");
  const std::string shown = ReadWholeFile(text);
  for (const std::string& command : CommandsIn(Rotslam({"--help"}).output)) {
    EXPECT_THAT(shown, ContainsRegex("rotslam " + command));
  }
  EXPECT_THAT(shown, AllOf(HasSubstr("--focal-guess"), HasSubstr("rotslam vocabulary train")));
}

}  // namespace
}  // namespace rotslam
