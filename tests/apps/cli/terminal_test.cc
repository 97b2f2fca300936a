// What a run tells while it works: on a terminal, into a file, in colour or not.

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/apps/small_sequence.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Contains;
using testing::ContainsRegex;
using testing::Each;
using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::MatchesRegex;
using testing::Not;
using testing::StartsWith;

class Terminal : public SmallSequenceTest {
 protected:
  std::vector<std::string> Rotations(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {"rotations", Good().string(), "--out=" + Out().string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  fs::path Log() const { return folder_.path() / "run.log"; }
};

TEST_F(Terminal, VerboseTellsOfEveryFrame) {
  const CommandResult result = Rotslam(Rotations({"--verbose"}));
  EXPECT_EQ(result.exit_code, 0);
  const std::vector<std::string> lines = Lines(result.error);
  for (int frame = 1; frame < kNumFrames; ++frame) {
    EXPECT_THAT(lines,
                Contains(ContainsRegex("^frame " + std::to_string(frame) +
                                       ": [0-9]+ points tracked, [1-9][0-9]* inliers")));
  }
  EXPECT_THAT(Lines(Rotslam(Rotations()).error), Each(Not(StartsWith("frame "))));
}

TEST_F(Terminal, TheLogHoldsWhatVerboseSaysWithTimes) {
  const std::string shown = Rotslam(Rotations({"--verbose"})).error;
  const CommandResult quiet = Rotslam(Rotations({"--quiet", "--log", Log().string()}));
  EXPECT_EQ(quiet.exit_code, 0);
  EXPECT_EQ(quiet.output + quiet.error, "");
  const std::string log = ReadWholeFile(Log());
  EXPECT_THAT(
      Lines(log),
      Each(ContainsRegex("^[0-9]{4}-[0-9]{2}-[0-9]{2} [0-9]{2}:[0-9]{2}:[0-9]{2}\\.[0-9]{3} "
                         "(debug|info|warning|error) +[^ ]")));
  for (const std::string& line : Lines(shown)) {
    // The end of a stage says how many seconds it took.
    if (!line.ends_with(" s")) {
      EXPECT_THAT(log, HasSubstr(" " + line + "\n"));
    }
  }
  EXPECT_THAT(log, ContainsRegex("info +orientations: 24 frames"));
}

TEST_F(Terminal, TheLogHoldsWarningsAndTheErrorAtTheEnd) {
  const fs::path sequence = Copy();
  for (const fs::path& image : Images(sequence)) {
    if (image != Images(sequence).front()) std::ofstream(image) << "no picture";
  }
  const CommandResult result = Rotslam({"rotations",
                                        sequence.string(),
                                        "--out=" + Out().string(),
                                        "--log=" + Log().string(),
                                        "--quiet"});
  EXPECT_EQ(result.exit_code, 1);
  const std::vector<std::string> log = Lines(ReadWholeFile(Log()));
  EXPECT_THAT(log, Contains(ContainsRegex("warning +frame 1 skipped")));
  EXPECT_THAT(log.back(), ContainsRegex("error +no two of the 24 frames could be matched"));
}

TEST_F(Terminal, ALogThatCannotBeWrittenIsRefused) {
  const CommandResult result = Rotslam(Rotations({"--log=/proc/nowhere/run.log"}));
  EXPECT_THAT(Refusal(result), StartsWith("/proc/nowhere/run.log: cannot write the log file"));
}

TEST_F(Terminal, ColoursOnlyWhereTheyAreWelcome) {
  if (!HasTerminals()) GTEST_SKIP() << "needs a terminal (/dev/pts)";
  const fs::path sequence = Copy();
  fs::remove(Images(sequence)[10]);
  const std::vector<std::string> arguments = {
      "rotations", sequence.string(), "--out=" + Out().string()};
  const std::string coloured = RotslamOnTerminal(arguments, 80, {"TERM=xterm", "NO_COLOR="}).output;
  EXPECT_THAT(coloured, HasSubstr("\033[1morientations\033[0m: 24 frames"));
  EXPECT_THAT(coloured, HasSubstr("\033[1;33mrotslam: warning:\033[0m frame 10 skipped"));
  for (const auto& environment : std::vector<std::vector<std::string>>{
           {"TERM=xterm", "NO_COLOR=1"}, {"TERM=dumb", "NO_COLOR="}}) {
    const std::string plain = RotslamOnTerminal(arguments, 80, environment).output;
    EXPECT_THAT(plain, AllOf(HasSubstr("\r\033[K"), Not(ContainsRegex("\033\\[[0-9;]*m"))));
  }
  // No terminal, no colours.
  EXPECT_THAT(Rotslam(arguments).error, Not(HasSubstr("\033")));
  const std::string error =
      RotslamOnTerminal({"rotations", "/nowhere", "--out=/tmp/x"}, 80, {"TERM=xterm", "NO_COLOR="})
          .output;
  EXPECT_THAT(error, StartsWith("\033[1;31mrotslam:\033[0m /nowhere"));
}

TEST_F(Terminal, TheRenewedLineShowsFiguresAndCountersAsFarAsThereIsRoom) {
  if (!HasTerminals()) GTEST_SKIP() << "needs a terminal (/dev/pts)";
  const auto renewed = [&](int columns) {
    std::vector<std::string> lines;
    const std::string output = RotslamOnTerminal(Rotations(), columns).output;
    const std::string start = "\r\033[K";
    for (std::size_t at = 0; (at = output.find(start, at)) != std::string::npos;) {
      at += start.size();
      const std::string line = output.substr(at, output.find_first_of("\r\n", at) - at);
      if (line.starts_with("orientations  ") && line.find("fps") != std::string::npos) {
        lines.push_back(line);
      }
    }
    return lines;
  };
  const std::string figures = "orientations  [0-9]+/24  [0-9.]+ fps  ETA [0-9]+:[0-9]{2}";
  const std::vector<std::string> wide = renewed(100);
  ASSERT_THAT(wide, Not(IsEmpty()));
  EXPECT_THAT(wide, Each(MatchesRegex(figures + "  [0-9]+ inliers  [0-9]+ loops?  1 segment")));
  // Nothing is cut off in the middle.
  const std::vector<std::string> narrow = renewed(48);
  ASSERT_THAT(narrow, Not(IsEmpty()));
  EXPECT_THAT(narrow, Each(MatchesRegex(figures)));
}

}  // namespace
}  // namespace rotslam
