// Ctrl-C while a run works: what there is gets written, the program says so and ends with 130.

#include <array>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/apps/run_directory.h"
#include "tests/apps/small_sequence.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

// A program that runs beside the test, with its standard error at hand as it comes.
class RunningProgram {
 public:
  explicit RunningProgram(const std::vector<std::string>& arguments) {
    std::vector<std::string> words = {ROTSLAM_EXECUTABLE};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> argv;
    argv.reserve(words.size() + 1);
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    std::array<int, 2> ends = {};
    EXPECT_EQ(pipe(ends.data()), 0);
    child_ = fork();
    if (child_ == 0) {
      // Whoever runs the tests in the background may have them ignored.
      std::signal(SIGINT, SIG_DFL);
      std::signal(SIGTERM, SIG_DFL);
      dup2(ends[1], STDERR_FILENO);
      close(ends[0]);
      close(ends[1]);
      execv(argv[0], argv.data());
      _exit(127);
    }
    close(ends[1]);
    error_ = ends[0];
  }
  ~RunningProgram() {
    if (child_ > 0) kill(child_, SIGKILL);
    Finish();
  }
  RunningProgram(const RunningProgram&) = delete;
  RunningProgram& operator=(const RunningProgram&) = delete;

  // Waits until standard error has shown `text`; false when the program ends without.
  bool WaitFor(const std::string& text) {
    while (shown_.find(text) == std::string::npos) {
      if (!ReadMore()) return false;
    }
    return true;
  }

  void Send(int signal) const { kill(child_, signal); }
  const std::string& shown() const { return shown_; }

  // Exit code at the end; -1: a signal ended it.
  int Finish() {
    if (child_ <= 0) return exit_code_;
    while (ReadMore()) {
    }
    close(error_);
    int status = 0;
    waitpid(child_, &status, 0);
    child_ = -1;
    exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    return exit_code_;
  }

 private:
  bool ReadMore() {
    std::array<char, 4096> buffer = {};
    const ssize_t count = read(error_, buffer.data(), buffer.size());
    if (count > 0) shown_.append(buffer.data(), static_cast<std::size_t>(count));
    return count > 0;
  }

  pid_t child_ = -1;
  int error_ = -1;
  int exit_code_ = -1;
  std::string shown_;
};

// The small sequence again and again: long enough to be in the middle of.
class InterruptedRun : public SmallSequenceTest {
 protected:
  void SetUp() override {
    const std::vector<fs::path> images = Images(Good());
    fs::create_directories(Long());
    for (int k = 0; k < kNumImages; ++k) {
      // There and back, so that neighbours match.
      const int turn = k % (2 * kNumFrames - 2);
      const int image = turn < kNumFrames ? turn : 2 * kNumFrames - 2 - turn;
      std::string number = std::to_string(k);
      number.insert(0, 5 - number.size(), '0');
      fs::create_hard_link(images[image], Long() / (number + ".png"));
    }
  }

  static constexpr int kNumImages = 3000;
  fs::path Long() const { return folder_.path() / "long"; }

  std::vector<std::string> Command(const std::string& command, const fs::path& sequence) const {
    return {command,
            sequence.string(),
            "--camera=" + (Good() / "camera.yaml").string(),
            "--out=" + Out().string(),
            "--no-loops",
            "--threads=1",
            "--verbose"};
  }

  // What every interrupted run must have left.
  void ExpectOrientationsOfPart() const {
    EXPECT_THAT(
        FileNames(Out()),
        ElementsAre(
            "loops.csv", "rotations.csv", "rotations_tum.txt", "summary.json", "view_graph.g2o"));
    const std::size_t count = ReadTrajectory(Out() / "rotations_tum.txt").size();
    EXPECT_GT(count, 5u);
    EXPECT_LT(count, std::size_t{kNumImages});
    const nlohmann::ordered_json summary = ReadSummary(Out());
    EXPECT_EQ(summary["interrupted"], true);
    EXPECT_EQ(summary["counts"]["frames"], count);
  }
};

class WithBothSignals : public InterruptedRun, public testing::WithParamInterface<int> {};
INSTANTIATE_TEST_SUITE_P(Signals, WithBothSignals, testing::Values(SIGINT, SIGTERM));

TEST_P(WithBothSignals, OrientationsSoFarAreWritten) {
  for (const std::string command : {"run", "rotations"}) {
    fs::remove_all(Out());
    RunningProgram program(Command(command, Long()));
    ASSERT_TRUE(program.WaitFor("frame 10:")) << program.shown();
    program.Send(GetParam());
    EXPECT_EQ(program.Finish(), 130) << program.shown();
    ExpectOrientationsOfPart();
    const std::size_t count = ReadTrajectory(Out() / "rotations_tum.txt").size();
    EXPECT_THAT(Lines(program.shown()).back(),
                HasSubstr("interrupted after " + std::to_string(count) + " frames"));
  }
}

TEST_F(InterruptedRun, WhileItFindsPositionsTheOrientationsOfAllFramesStay) {
  RunningProgram program(Command("run", Good()));
  ASSERT_TRUE(program.WaitFor("orientations: 24 frames")) << program.shown();
  program.Send(SIGINT);
  EXPECT_EQ(program.Finish(), 130) << program.shown();
  EXPECT_EQ(ReadTrajectory(Out() / "rotations_tum.txt").size(), std::size_t{kNumFrames});
  // On a quick machine the signal may come when all is done.
  const bool is_complete = fs::exists(Out() / "map_all_frames.bin");
  EXPECT_EQ(ReadSummary(Out()).contains("interrupted"), !is_complete);
  EXPECT_THAT(Lines(program.shown()).back(),
              HasSubstr(is_complete ? "wrote " : "interrupted after 24 frames"));
}

TEST_F(InterruptedRun, TheSecondSignalEndsAtOnceAndLeavesNoHalfFiles) {
  RunningProgram program(Command("run", Long()));
  ASSERT_TRUE(program.WaitFor("frame 10:")) << program.shown();
  const auto start = std::chrono::steady_clock::now();
  program.Send(SIGINT);
  // Signals of one number do not queue up.
  program.Send(SIGTERM);
  EXPECT_EQ(program.Finish(), 130) << program.shown();
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(30));
  for (const std::string& name : FileNames(Out())) EXPECT_FALSE(name.ends_with(".tmp")) << name;
}

}  // namespace
}  // namespace rotslam
