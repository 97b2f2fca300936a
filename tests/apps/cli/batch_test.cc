// `rotslam batch`: good and bad sequences together, again, collected, and as an array job.

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "output/trajectory/metrics.h"
#include "tests/apps/run_directory.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

class Batch : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = new TemporaryFolder;
    for (const char* kind : {"handheld", "gimbal"}) {
      const CommandResult result = Rotslam({"simulate",
                                            kind,
                                            "--width=320",
                                            "--height=240",
                                            "--frames=24",
                                            "--quiet",
                                            "--out=" + (shared_->path() / kind).string()});
      ASSERT_EQ(result.exit_code, 0) << result.error;
    }
  }
  static void TearDownTestSuite() {
    delete shared_;
    shared_ = nullptr;
  }

  // Two sequences and one whose path leads nowhere.
  fs::path List(const std::string& walk_options = "{}") const {
    const std::string walk = (shared_->path() / "handheld").string();
    const std::string turn = (shared_->path() / "gimbal").string();
    return folder_.Write("list.yaml",
                         "- name: walk\n  path: " + walk + "\n  ground_truth: " + walk +
                             "/groundtruth_tum.txt\n  options: " + walk_options +
                             "\n"
                             "- name: broken\n  path: 'no & <such>, \"thing\"'\n"
                             "- path: " +
                             turn + "\n  command: rotations\n");
  }

  fs::path Out() const { return folder_.path() / "out"; }

  CommandResult RunBatch(const fs::path& list, const std::vector<std::string>& more = {}) const {
    return Rotslam({"batch", list.string(), "--out", Out().string()}, more);
  }

  // Lines of results.csv by name. None of these tests has a comma before the last column.
  std::map<std::string, std::map<std::string, std::string>> Results() const {
    const std::vector<std::string> lines = Lines(ReadWholeFile(Out() / "results.csv"));
    std::map<std::string, std::map<std::string, std::string>> results;
    const std::vector<std::string> names = Cut(lines.empty() ? "" : lines[0]);
    for (std::size_t k = 1; k < lines.size(); ++k) {
      const std::vector<std::string> fields = Cut(lines[k]);
      if (fields[0].starts_with('(')) continue;  // the summary
      for (std::size_t n = 0; n < names.size() && n < fields.size(); ++n) {
        results[fields[0]][names[n]] = fields[n];
      }
    }
    return results;
  }

  static std::vector<std::string> Cut(const std::string& line) {
    std::vector<std::string> fields;
    std::istringstream stream(line);
    for (std::string field; std::getline(stream, field, ',');) fields.push_back(field);
    return fields;
  }

  static auto Written(const fs::path& file) { return fs::last_write_time(file); }

  const TemporaryFolder folder_;
  static inline const TemporaryFolder* shared_ = nullptr;
};

TEST_F(Batch, SurvivesABrokenSequenceAndGoesOnWhereItStopped) {
  const fs::path list = List();
  const CommandResult first = RunBatch(list, {"--jobs", "2"});
  EXPECT_EQ(first.exit_code, 1);
  EXPECT_THAT(first.error, HasSubstr("1 of 3 sequences are not done"));

  auto results = Results();
  ASSERT_EQ(results.size(), 3u);
  EXPECT_EQ(results["walk"]["status"], "done");
  EXPECT_EQ(results["walk"]["frames"], "24");
  const std::vector<std::string> table = Lines(ReadWholeFile(Out() / "results.csv"));
  ASSERT_EQ(table.size(), 6u);
  EXPECT_THAT(table[4], AllOf(testing::StartsWith("(median),"), HasSubstr(",2 of 3 done,")));
  EXPECT_THAT(table[5], AllOf(testing::StartsWith("(worst),"), HasSubstr(",1 failed,")));
  EXPECT_THAT(ReadWholeFile(Out() / "results.html"),
              HasSubstr("<a href=\"broken/log.txt\">failed</a>"));
  EXPECT_EQ(results["walk"]["coverage"], "1.0000");
  const TrajectoryMetrics metrics =
      Compare(shared_->path() / "handheld/groundtruth_tum.txt", Out() / "walk/trajectory_tum.txt");
  EXPECT_NEAR(std::stod(results["walk"]["rpe1_deg"]), metrics.rpe1_deg, 1e-9);
  EXPECT_NEAR(std::stod(results["walk"]["rpen_deg"]), metrics.rpen_deg, 1e-9);
  EXPECT_NEAR(std::stod(results["walk"]["ate_m"]), metrics.ate_m.value(), 1e-9);
  EXPECT_EQ(std::stoi(results["walk"]["points"]),
            ReadSummary(Out() / "walk")["counts"]["points"].get<int>());
  EXPECT_GT(std::stod(results["walk"]["cpu_s"]), 0.0);
  EXPECT_EQ(results["gimbal"]["status"], "done");
  EXPECT_EQ(results["gimbal"]["coverage"], "1.0000") << "its ground truth lies with the images";
  EXPECT_EQ(results["gimbal"]["points"], "") << "orientations alone have no points";
  EXPECT_EQ(results["gimbal"]["ate_m"], "");
  EXPECT_EQ(results["broken"]["status"], "failed");
  EXPECT_THAT(results["broken"]["note"], HasSubstr("exit code 1: "));
  const auto record = nlohmann::json::parse(ReadWholeFile(Out() / "broken/batch.json"));
  EXPECT_EQ(record["exit_code"], 1);
  EXPECT_THAT(record["error"].get<std::string>(), HasSubstr("no & <such>, \"thing\""));
  const std::string page = ReadWholeFile(Out() / "results.html");
  EXPECT_THAT(page, AllOf(HasSubstr("no &amp; &lt;such&gt;"), Not(HasSubstr("<such>"))));
  EXPECT_THAT(page, AllOf(HasSubstr("prefers-color-scheme: dark"), Not(HasSubstr("http"))));

  // Again: what is done stays as it is, the broken one is tried anew.
  const auto walk_written = Written(Out() / "walk/summary.json");
  const auto broken_written = Written(Out() / "broken/batch.json");
  const CommandResult second = RunBatch(list);
  EXPECT_EQ(second.exit_code, 1);
  EXPECT_THAT(second.error, HasSubstr("walk: done before"));
  EXPECT_THAT(second.error, HasSubstr("broken: started")) << "no checkpoint to go on from";
  EXPECT_EQ(Written(Out() / "walk/summary.json"), walk_written);
  EXPECT_NE(Written(Out() / "broken/batch.json"), broken_written);

  // A run that lost its end, and one with other options, are not done.
  fs::resize_file(Out() / "gimbal/summary.json", 100);
  const fs::path changed = List("{krot: {start: positioning}}");
  EXPECT_EQ(RunBatch(changed, {"--collect"}).exit_code, 1);
  results = Results();
  EXPECT_EQ(results["walk"]["status"], "outdated");
  EXPECT_EQ(results["gimbal"]["status"], "failed");
  EXPECT_EQ(Written(Out() / "walk/summary.json"), walk_written) << "--collect runs nothing";
  RunBatch(changed);
  EXPECT_THAT(ReadWholeFile(Out() / "results.html"),
              AllOf(HasSubstr("<a href=\"gimbal/report.html\">gimbal</a>"),
                    HasSubstr("<a href=\"walk/report.html\">walk</a>"),
                    Not(HasSubstr("broken/report.html"))));
  EXPECT_NE(Written(Out() / "walk/summary.json"), walk_written);
  EXPECT_EQ(ReadSummary(Out() / "walk")["options"]["krot"]["start"], "positioning");
  results = Results();
  EXPECT_EQ(results["walk"]["status"], "done");
  EXPECT_EQ(results["gimbal"]["status"], "done");
}

TEST_F(Batch, GivesWhatTheCommandsGive) {
  const fs::path list = List("{sequence: {stride: 2}}");
  RunBatch(list, {"--seed", "5", "--quiet"});
  const std::string walk = (shared_->path() / "handheld").string();
  const fs::path alone = folder_.path() / "alone";
  const CommandResult run =
      Rotslam({"run", walk, "--stride", "2", "--seed", "5", "--quiet", "--out", alone.string()});
  ASSERT_EQ(run.exit_code, 0) << run.error;
  EXPECT_EQ(ReadWholeFile(Out() / "walk/trajectory_tum.txt"),
            ReadWholeFile(alone / "trajectory_tum.txt"));
  EXPECT_EQ(ReadSummary(Out() / "walk")["options"], ReadSummary(alone)["options"]);
}

TEST_F(Batch, StopsInGoodOrderAndGoesOn) {
  const std::string list = List().string();
  const std::string out = Out().string();
  const pid_t batch = fork();
  if (batch == 0) {
    execl(ROTSLAM_EXECUTABLE,
          "rotslam",
          "batch",
          list.c_str(),
          "--out",
          out.c_str(),
          "--quiet",
          nullptr);
    _exit(127);
  }
  while (!fs::exists(Out() / "walk/log.txt")) usleep(1000);
  kill(batch, SIGINT);
  int status = 0;
  waitpid(batch, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), 130);
  auto results = Results();
  EXPECT_EQ(results["walk"]["status"], "failed") << "the child has been told, too";
  EXPECT_EQ(results["gimbal"]["status"], "not run");
  RunBatch(list);
  results = Results();
  EXPECT_EQ(results["walk"]["status"], "done");
  EXPECT_EQ(results["gimbal"]["status"], "done");
}

TEST_F(Batch, RunsSequencesWithoutCalibration) {
  const fs::path images = folder_.path() / "uncalibrated";
  fs::create_directories(images);
  for (const auto& entry : fs::directory_iterator(shared_->path() / "handheld/rgb")) {
    fs::create_hard_link(entry.path(), images / entry.path().filename());
  }
  const std::string path = "- path: " + images.string() + "\n  command: rotations\n";
  for (const char* more : {"", "  camera: none\n"}) {
    const CommandResult result = RunBatch(folder_.Write("uncalibrated.yaml", path + more));
    ASSERT_EQ(result.exit_code, 0) << result.error;
    EXPECT_EQ(Results()["uncalibrated"]["status"], "done");
    const auto summary = nlohmann::json::parse(ReadWholeFile(Out() / "uncalibrated/summary.json"));
    EXPECT_EQ(summary["calibration"]["source"], "images");
  }
}

// A long sequence that is stopped in its middle, however that comes about.
class InterruptedBatch : public Batch {
 protected:
  void SetUp() override {
    std::vector<fs::path> images;
    for (const auto& entry : fs::directory_iterator(shared_->path() / "handheld/rgb")) {
      images.push_back(entry.path());
    }
    std::sort(images.begin(), images.end());
    ASSERT_EQ(images.size(), 24u);
    fs::create_directories(Long());
    for (int k = 0; k < kNumImages; ++k) {
      const int turn = k % 46;  // there and back, so that neighbours match
      fs::create_hard_link(images[turn < 24 ? turn : 46 - turn], ImageOfLong(k));
    }
  }

  static constexpr int kNumImages = 150;
  fs::path Long() const { return folder_.path() / "long"; }
  fs::path ImageOfLong(int k) const { return Long() / (std::to_string(10000 + k) + ".png"); }
  fs::path State() const { return Out() / "long/unfinished/state.bin"; }
  std::string Log() const { return ReadWholeFile(Out() / "long/log.txt"); }

  fs::path LongList(const std::string& features = "400") const {
    return folder_.Write("long.yaml",
                         "- path: " + Long().string() + "\n  command: rotations\n  camera: " +
                             (shared_->path() / "handheld/camera.yaml").string() +
                             "\n  options: {loop: {use_loops: false}, rotodom: {features: "
                             "{max_features: " +
                             features + "}}}\n");
  }

  // Starts a batch and waits for the first checkpoint; the batch then stands still, its child
  // works.
  pid_t StartAndHold(const fs::path& list) const {
    const pid_t batch = fork();
    if (batch == 0) {
      signal(SIGINT, SIG_DFL);
      execl(ROTSLAM_EXECUTABLE,
            "rotslam",
            "batch",
            list.c_str(),
            "--out",
            Out().c_str(),
            "--threads=1",
            "--checkpoint-every=5",
            "--quiet",
            nullptr);
      _exit(127);
    }
    while (!fs::exists(State()) && waitpid(batch, nullptr, WNOHANG) == 0) usleep(1000);
    EXPECT_TRUE(fs::exists(State()));
    kill(batch, SIGSTOP);
    return batch;
  }

  static pid_t ChildOf(pid_t batch) {
    const std::string id = std::to_string(batch);
    return static_cast<pid_t>(
        std::stoi(ReadWholeFile(fs::path("/proc") / id / "task" / id / "children")));
  }

  static int End(pid_t batch) {
    int status = 0;
    waitpid(batch, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

  void ExpectWhatARunInOnePieceGives(const fs::path& list) const {
    const fs::path whole = folder_.path() / "whole";
    ASSERT_EQ(Rotslam({"batch", list.string(), "--out", whole.string(), "--quiet"}).exit_code, 0);
    for (const char* name : {"rotations_tum.txt", "rotations.csv", "loops.csv", "view_graph.g2o"}) {
      EXPECT_EQ(ReadWholeFile(Out() / "long" / name), ReadWholeFile(whole / "long" / name)) << name;
    }
    EXPECT_FALSE(fs::exists(Out() / "long/unfinished"));
  }
};

enum class Stop { kInterrupt, kKillChild, kKillBatch };

class StoppedBatch : public InterruptedBatch, public testing::WithParamInterface<Stop> {};
INSTANTIATE_TEST_SUITE_P(Ways,
                         StoppedBatch,
                         testing::Values(Stop::kInterrupt, Stop::kKillChild, Stop::kKillBatch));

TEST_P(StoppedBatch, GoesOnInTheMiddleOfASequence) {
  const fs::path list = LongList();
  const pid_t batch = StartAndHold(list);
  const pid_t child = ChildOf(batch);
  prctl(PR_SET_CHILD_SUBREAPER, 1);  // the batch's child is ours when it is gone
  if (GetParam() == Stop::kInterrupt) kill(batch, SIGINT);
  if (GetParam() == Stop::kKillChild) kill(child, SIGKILL);
  if (GetParam() == Stop::kKillBatch) {
    // The time until then is written down while the child runs.
    kill(child, SIGSTOP);
    kill(batch, SIGCONT);
    const fs::path record = Out() / "long/batch.json";
    const auto has_time = [&] {
      return ReadWholeFile(record).find("running_wall_s") != std::string::npos;
    };
    for (int k = 0; k < 6000 && !has_time(); ++k) usleep(10000);
    kill(batch, SIGKILL);
  }
  kill(batch, SIGCONT);
  const std::map<Stop, int> exit_codes = {
      {Stop::kInterrupt, 130}, {Stop::kKillChild, 1}, {Stop::kKillBatch, -SIGKILL}};
  EXPECT_EQ(End(batch), exit_codes.at(GetParam()));
  if (GetParam() == Stop::kKillBatch) {
    EXPECT_EQ(End(child), -SIGKILL) << "works on unseen";
  }
  ASSERT_TRUE(fs::exists(State()));
  EXPECT_EQ(RunBatch(list, {"--collect"}).exit_code, 1);
  EXPECT_EQ(Results()["long"]["status"], GetParam() == Stop::kKillBatch ? "unfinished" : "failed");

  const CommandResult second = RunBatch(list);
  EXPECT_EQ(second.exit_code, 0) << second.error;
  EXPECT_THAT(second.error, HasSubstr("long: goes on where it was interrupted"));
  EXPECT_THAT(Log(), HasSubstr("resumed: frames 0 to "));
  EXPECT_EQ(Results()["long"]["status"], "done");
  EXPECT_EQ(Results()["long"]["frames"], std::to_string(kNumImages));
  // The time of both parts.
  const auto record = nlohmann::json::parse(ReadWholeFile(Out() / "long/batch.json"));
  EXPECT_GT(record["earlier_wall_s"], 0.0);
  EXPECT_GT(record["earlier_cpu_s"], 0.0);
  EXPECT_GT(record["wall_s"], record["earlier_wall_s"]);
  EXPECT_GT(record["cpu_s"], record["earlier_cpu_s"]);
  EXPECT_FALSE(record.contains("running_wall_s"));
  ExpectWhatARunInOnePieceGives(list);
}

TEST_F(InterruptedBatch, StartsAnewWhenAskedForSomethingElse) {
  const pid_t batch = StartAndHold(LongList());
  kill(ChildOf(batch), SIGKILL);
  kill(batch, SIGCONT);
  EXPECT_EQ(End(batch), 1);
  const fs::path list = LongList("300");
  const CommandResult second = RunBatch(list);
  EXPECT_EQ(second.exit_code, 0) << second.error;
  EXPECT_THAT(second.error, HasSubstr("long: started"));
  EXPECT_THAT(Log(), Not(HasSubstr("resumed")));
  ExpectWhatARunInOnePieceGives(list);
}

TEST_F(InterruptedBatch, SaysThatTheImagesHaveChangedAndThenStartsAnew) {
  const fs::path list = LongList();
  const pid_t batch = StartAndHold(list);
  kill(ChildOf(batch), SIGKILL);
  kill(batch, SIGCONT);
  EXPECT_EQ(End(batch), 1);
  fs::create_hard_link(ImageOfLong(kNumImages % 46), ImageOfLong(kNumImages));
  EXPECT_EQ(RunBatch(list).exit_code, 1);
  EXPECT_THAT(ReadWholeFile(Out() / "results.csv"), HasSubstr("is of another run: the sequence"));
  const CommandResult third = RunBatch(list);
  EXPECT_EQ(third.exit_code, 0) << third.error;
  EXPECT_THAT(third.error, HasSubstr("long: started"));
  EXPECT_EQ(Results()["long"]["frames"], std::to_string(kNumImages + 1));
}

TEST_F(Batch, RunsAsAnArrayJob) {
  // A folder that a careless script would take apart.
  const fs::path strange = folder_.path() / "it's $HOME; \"%a\" `x`";
  fs::create_directory(strange);
  const fs::path list = strange / "list.yaml";
  fs::copy_file(List(), list);
  const fs::path out = strange / "out";
  const std::string script = (strange / "job.sh").string();
  const CommandResult written = Rotslam({"batch",
                                         list.string(),
                                         "--out",
                                         out.string(),
                                         "--slurm",
                                         script,
                                         "--jobs",
                                         "2",
                                         "--slurm-options",
                                         "--time=2:00:00 --mem 8G"});
  ASSERT_EQ(written.exit_code, 0) << written.error;
  EXPECT_THAT(ReadWholeFile(script), HasSubstr("\n#SBATCH --time=2:00:00\n#SBATCH --mem 8G\n"));
  EXPECT_THAT(ReadWholeFile(script), HasSubstr("\n#SBATCH --array=1-3%2\n"));
  EXPECT_THAT(Lines(ReadWholeFile(script)),
              Not(Contains(AllOf(HasSubstr("#SBATCH"), HasSubstr("HOME")))));

  for (const auto& [task, exit_code] : std::map<std::string, int>{{"1", 0}, {"2", 1}, {"3", 0}}) {
    const std::string command = "SLURM_ARRAY_TASK_ID=" + task + " bash " + Quoted(script);
    EXPECT_EQ(WEXITSTATUS(std::system(command.c_str())), exit_code) << task;
    EXPECT_GT(fs::file_size(out / "slurm" / (task + ".txt")), 0u);
  }
  EXPECT_FALSE(fs::exists(out / "results.csv")) << "each task is independent";
  EXPECT_NE(std::system(("bash " + Quoted(script) + " 2>/dev/null").c_str()), 0);

  const CommandResult collected =
      Rotslam({"batch", list.string(), "--out", out.string(), "--collect"});
  EXPECT_EQ(collected.exit_code, 1);
  const std::string csv = ReadWholeFile(out / "results.csv");
  EXPECT_THAT(Lines(csv), testing::SizeIs(6));
  EXPECT_THAT(csv, AllOf(HasSubstr("\nwalk,24,1.0000,"), HasSubstr("\nbroken,,,")));
}

}  // namespace
}  // namespace rotslam
