// Ctrl-C while a run works: what there is gets written, the program says so and ends with 130.

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/apps/run_directory.h"
#include "tests/apps/running_program.h"
#include "tests/apps/small_sequence.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

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
    EXPECT_THAT(FileNames(Out()),
                ElementsAre("loops.csv",
                            "rotations.csv",
                            "rotations_tum.txt",
                            "summary.json",
                            "unfinished/frames.bin",
                            "unfinished/state.bin",
                            "view_graph.g2o"));
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
    EXPECT_THAT(Lines(program.shown()).back(), HasSubstr("--resume goes on from here"));
  }
}

TEST_F(InterruptedRun, ReplacesTheFilesOfARunBefore) {
  // The good sequence, and what a program before this one might have left.
  ASSERT_EQ(Run(Good(), {"--report"}).exit_code, 0);
  std::ofstream(Out() / "pose_covariance.csv") << "old";
  std::ofstream(Out() / "notes.txt") << "mine";
  ASSERT_TRUE(fs::exists(Out() / "trajectory_tum.txt"));
  RunningProgram program(Command("run", Long()));
  ASSERT_TRUE(program.WaitFor("frame 10:")) << program.shown();
  // As long as the new run has nothing to show, the old one is there.
  EXPECT_TRUE(fs::exists(Out() / "trajectory_tum.txt"));
  program.Send(SIGINT);
  EXPECT_EQ(program.Finish(), 130) << program.shown();
  EXPECT_EQ(ReadWholeFile(Out() / "notes.txt"), "mine");
  fs::remove(Out() / "notes.txt");
  ExpectOrientationsOfPart();
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
