// A run that is killed, by whatever and at any moment: nothing is lost, and --resume gives the
// bytes of a run in a single piece.

#include <chrono>
#include <csignal>
#include <filesystem>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "rotodom/camera/read_camera.h"
#include "tests/apps/run_directory.h"
#include "tests/apps/running_program.h"
#include "tests/apps/small_sequence.h"
#include "tests/apps/unknown_readout.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ContainsRegex;
using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

// While it lives, files can grow no further: what a disk that is full says, or a quota.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t num_bytes) {
    getrlimit(RLIMIT_FSIZE, &before_);
    rlimit limit = before_;
    limit.rlim_cur = num_bytes;
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() { setrlimit(RLIMIT_FSIZE, &before_); }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit before_ = {};
};

class CheckpointedRun : public SmallSequenceTest {
 protected:
  // What a run in a single piece leaves, made once for each command.
  const fs::path& InOnePiece(const std::string& command) const {
    fs::path& out = command == "run" ? run_in_one_piece_ : rotations_in_one_piece_;
    if (out.empty()) {
      out = Good().parent_path() / (command + "_in_one_piece");
      const CommandResult result = Rotslam({command,
                                            Good().string(),
                                            "--out=" + out.string(),
                                            "--quiet",
                                            "--no-report",
                                            "--checkpoint-every=0"});
      EXPECT_EQ(result.exit_code, 0) << result.error;
    }
    return out;
  }

  std::vector<std::string> Command(const std::vector<std::string>& more = {},
                                   const std::string& command = "run",
                                   int every = 5) const {
    std::vector<std::string> words = {command,
                                      Good().string(),
                                      "--out=" + Out().string(),
                                      "--no-report",
                                      "--checkpoint-every=" + std::to_string(every)};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }

  // Ends the command by the signal once it has shown `text`.
  void StopAt(const std::string& text, int signal, const std::string& command = "run") const {
    RunningProgram program(Command({"--verbose"}, command));
    ASSERT_TRUE(program.WaitFor(text)) << program.shown();
    program.Send(signal);
    EXPECT_EQ(program.Finish(), signal == SIGKILL ? -1 : 130) << program.shown();
  }

  CommandResult Resume(const std::vector<std::string>& more = {},
                       const std::string& command = "run") const {
    return Rotslam(Command({"--resume"}, command), more);
  }

  fs::path State() const { return Out() / "unfinished" / "state.bin"; }
  fs::path Frames() const { return Out() / "unfinished" / "frames.bin"; }

  // The one line that says why --resume does not go on; the checkpoint stays.
  std::string RefusalToResume(std::vector<std::string> more = {},
                              const std::string& command = "run") const {
    more.push_back("--quiet");
    const CommandResult result = Resume(more, command);
    EXPECT_EQ(result.exit_code, 1) << result.error;
    EXPECT_TRUE(fs::exists(State()));
    EXPECT_TRUE(fs::exists(Frames()));
    EXPECT_THAT(Lines(result.error), ElementsAre(testing::StartsWith("rotslam: ")));
    return result.error;
  }

  // A copy of the results that are there. Where the program was killed while it put new ones in
  // place of old ones, which the next run makes up for, the rest of the new ones.
  fs::path Results() const {
    const fs::path results = folder_.path() / "results";
    fs::remove_all(results);
    fs::create_directory(results);
    std::vector<fs::path> folders = {Out()};
    if (!fs::exists(Out() / "summary.json")) {
      for (const char* name : {"outputs", "moving"}) {
        const fs::path folder = Out() / "unfinished" / name;
        if (fs::exists(folder / "summary.json")) folders.push_back(folder);
      }
      EXPECT_EQ(folders.size(), 2u);
    }
    for (const fs::path& folder : folders) {
      for (const auto& entry : fs::directory_iterator(folder)) {
        const std::string name = entry.path().filename().string();
        if (entry.is_directory() || name.starts_with(".write_test")) continue;
        fs::copy_file(entry.path(), results / name, fs::copy_options::overwrite_existing);
      }
    }
    return results;
  }

 private:
  static inline fs::path run_in_one_piece_;
  static inline fs::path rotations_in_one_piece_;
};

TEST_F(CheckpointedRun, GoesOnToTheSameBytesWhereverItWasKilled) {
  for (const std::string moment : {"frame 2:", "frame 6:", "frame 17:", "orientations: 24"}) {
    SCOPED_TRACE(moment);
    fs::remove_all(Out());
    StopAt(moment, SIGKILL);
    const bool has_checkpoint = fs::exists(State());
    // After frame 5 the next record comes with a checkpoint behind it.
    EXPECT_EQ(has_checkpoint, moment != "frame 2:");
    const CommandResult result = Resume();
    ASSERT_EQ(result.exit_code, 0) << result.error;
    EXPECT_THAT(result.error,
                HasSubstr(has_checkpoint ? "resumed: frames 0 to " : "no checkpoint in "));
    ExpectSameRun(Out(), InOnePiece("run"));
  }
}

TEST_F(CheckpointedRun, GoesOnAfterCtrlCFromThatFrameAtAnyNumberOfThreads) {
  for (const std::string command : {"run", "rotations"}) {
    SCOPED_TRACE(command);
    fs::remove_all(Out());
    StopAt("frame 12:", SIGINT, command);
    const std::size_t count = ReadTrajectory(Out() / "rotations_tum.txt").size();
    EXPECT_EQ(ReadSummary(Out())["interrupted"], true);
    const CommandResult result = Resume({"--threads=2"}, command);
    ASSERT_EQ(result.exit_code, 0) << result.error;
    EXPECT_THAT(result.error, HasSubstr("resumed: frames 0 to " + std::to_string(count - 1) + " "));
    ExpectSameRun(Out(), InOnePiece(command));
  }
}

// A sequence whose shutter turns out to roll is read twice.
TEST_F(CheckpointedRun, GoesOnInTheSecondReadingWithTheReadoutThatTheFirstHasFound) {
  const fs::path sequence = folder_.path() / "rolling";
  ASSERT_NO_FATAL_FAILURE(SimulateUnknownReadout(sequence));
  const auto command = [&](const fs::path& out) {
    return std::vector<std::string>{"rotations",
                                    sequence.string(),
                                    "--out=" + out.string(),
                                    "--no-report",
                                    "--verbose",
                                    "--checkpoint-every=5"};
  };
  const fs::path whole = folder_.path() / "whole";
  ASSERT_EQ(Rotslam(command(whole)).exit_code, 0);
  RunningProgram program(command(Out()));
  ASSERT_TRUE(program.WaitFor("starts again")) << program.shown();
  ASSERT_TRUE(program.WaitForNext("frame 12:")) << program.shown();
  program.Send(SIGINT);
  ASSERT_EQ(program.Finish(), 130) << program.shown();
  EXPECT_LT(ReadTrajectory(Out() / "rotations_tum.txt").size(), 45u);
  const CommandResult result = Rotslam(command(Out()), {"--resume"});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(result.error, HasSubstr("resumed: frames 0 to "));
  EXPECT_THAT(result.error, Not(HasSubstr("starts again")));
  ExpectSameRun(Out(), whole);
}

TEST_F(CheckpointedRun, WritesAReportInTheEnd) {
  StopAt("frame 12:", SIGKILL);
  ASSERT_EQ(Resume({"--report"}).exit_code, 0);
  EXPECT_TRUE(fs::exists(Out() / "report.html"));
  fs::remove(Out() / "report.html");
  ExpectSameRun(Out(), InOnePiece("run"));
}

TEST_F(CheckpointedRun, AnewMeansAnew) {
  StopAt("frame 12:", SIGKILL);
  const CommandResult result = Rotslam(Command());
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(result.error, HasSubstr("throws away the checkpoint"));
  ExpectSameRun(Out(), InOnePiece("run"));
}

TEST_F(CheckpointedRun, WithoutCheckpointsThereAreNone) {
  RunningProgram program(Command({"--verbose"}, "run", 0));
  ASSERT_TRUE(program.WaitFor("frame 12:")) << program.shown();
  program.Send(SIGKILL);
  program.Finish();
  EXPECT_THAT(FileNames(Out()), IsEmpty());
}

TEST_F(CheckpointedRun, RefusesWhatIsNotTheSameRun) {
  StopAt("frame 12:", SIGKILL);
  EXPECT_THAT(RefusalToResume({"--no-loops"}),
              AllOf(HasSubstr(State().string()),
                    HasSubstr("loop.use_loops was true, is now false"),
                    HasSubstr("leave --resume out")));
  EXPECT_THAT(RefusalToResume({"--seed=2"}), HasSubstr("the seed was 1, is now 2"));
  EXPECT_THAT(RefusalToResume({"--last=20"}), HasSubstr("the sequence was 24 files"));
  Camera camera = ReadCamera(Good() / "camera.yaml");
  camera.readout_s = 0.001;
  const fs::path file = folder_.path() / "camera.yaml";
  WriteCameraYaml(file, camera);
  EXPECT_THAT(RefusalToResume({"--camera=" + file.string()}), HasSubstr("the camera was "));
  EXPECT_THAT(RefusalToResume({}, "rotations"), HasSubstr("the command was run, is now rotations"));
  ASSERT_EQ(Resume().exit_code, 0);
  ExpectSameRun(Out(), InOnePiece("run"));
}

TEST_F(CheckpointedRun, RefusesADamagedCheckpoint) {
  StopAt("frame 12:", SIGKILL);
  for (const fs::path& file : {State(), Frames()}) {
    SCOPED_TRACE(file);
    const std::string whole = ReadWholeFile(file);
    const auto refusal_of = [&](const std::string& content) {
      std::ofstream(file, std::ios::binary) << content;
      const std::string refusal = RefusalToResume();
      EXPECT_THAT(refusal, AllOf(HasSubstr(file.string()), HasSubstr("leave --resume out")));
      return refusal;
    };
    EXPECT_THAT(refusal_of(""), HasSubstr(file == State() ? "is no checkpoint" : "cut short"));
    refusal_of(whole.substr(0, 1000));
    std::mt19937 random(1);
    for (int k = 0; k < 3; ++k) {
      std::string damaged = whole;
      // Of the journal, the first records count in any case.
      const std::size_t at = random() % (file == State() ? whole.size() : whole.size() / 4);
      damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
      refusal_of(damaged);
    }
    std::ofstream(file, std::ios::binary) << whole;
  }
  ASSERT_EQ(Resume().exit_code, 0);
  ExpectSameRun(Out(), InOnePiece("run"));
}

// Two runs by turns into one folder, with different seeds, killed all the time.
TEST_F(CheckpointedRun, LosesNothingWhenKilledAtAnyMoment) {
  constexpr int kNumKills = 50;
  const auto command = [&](int which) {
    const std::string seed = "--seed=" + std::to_string(which + 1);
    return Command({seed, "--quiet", "--last=13", "--no-certificate"}, "run", 2);
  };
  std::vector<fs::path> complete;
  double seconds = 0.0;
  for (int which : {0, 1}) {
    const auto start = std::chrono::steady_clock::now();
    ASSERT_EQ(Rotslam(command(which)).exit_code, 0);
    seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    complete.push_back(folder_.path() / ("complete_" + std::to_string(which)));
    fs::copy(Out(), complete.back(), fs::copy_options::recursive);
  }
  std::mt19937 random(1);
  std::uniform_real_distribution<double> moment_s(0.0, seconds);
  int there = 1;  // whose results are in the folder
  int next = 0;
  bool resume = false;
  int num_kills = 0;
  int num_completed = 0;
  while (num_kills < kNumKills) {
    std::vector<std::string> words = command(next);
    if (resume) words.push_back("--resume");
    RunningProgram program(words);
    std::this_thread::sleep_for(std::chrono::duration<double>(moment_s(random)));
    program.Send(SIGKILL);
    const int exit_code = program.Finish();
    ASSERT_TRUE(exit_code == -1 || exit_code == 0) << program.shown();
    num_kills += exit_code == -1;
    const fs::path results = Results();
    // Killed on its last steps, it may have been complete.
    if (ReadWholeFile(results / "rotations_tum.txt") ==
        ReadWholeFile(complete[next] / "rotations_tum.txt")) {
      there = next;
    }
    ExpectSameRun(results, complete[there]);
    resume = exit_code != 0;
    if (exit_code == 0) {
      EXPECT_EQ(there, next);
      EXPECT_FALSE(fs::exists(Out() / "unfinished"));
      next = 1 - next;
      ++num_completed;
    }
    if (HasFailure()) break;
  }
  EXPECT_GT(num_completed, 1);
  std::vector<std::string> words = command(next);
  words.push_back("--resume");
  ASSERT_EQ(Rotslam(words).exit_code, 0);
  ExpectSameRun(Out(), complete[next]);
}

TEST_F(CheckpointedRun, GoesOnWithoutCheckpointsWhereTheyFindNoRoom) {
  const CommandResult result = [&] {
    const FileSizeLimit limit(fs::file_size(InOnePiece("run") / "map_all_frames.bin") + 4096);
    return Rotslam(Command({"--quiet"}, "run", 1));
  }();
  EXPECT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(
      Lines(result.error),
      ElementsAre(AllOf(HasSubstr("warning: no checkpoints from here on: "),
                        ContainsRegex("(frames|state).bin: cannot write the file: File too large"),
                        HasSubstr("the one after "),
                        EndsWith("frames stays"))));
  ExpectSameRun(Out(), InOnePiece("run"));
}

TEST_F(CheckpointedRun, KeepsTheOldResultsAndTheCheckpointWhereTheNewOnesFindNoRoom) {
  ASSERT_EQ(Rotslam(Command({"--seed=2"})).exit_code, 0);
  const fs::path old = folder_.path() / "old";
  fs::copy(Out(), old, fs::copy_options::recursive);
  StopAt("orientations: 24", SIGKILL);
  {
    const FileSizeLimit limit(fs::file_size(InOnePiece("run") / "map_all_frames.bin") / 2);
    EXPECT_THAT(RefusalToResume(), HasSubstr("cannot write the file: File too large"));
  }
  ExpectSameRun(Results(), old);
  ASSERT_EQ(Resume().exit_code, 0);
  ExpectSameRun(Out(), InOnePiece("run"));
}

}  // namespace
}  // namespace rotslam
