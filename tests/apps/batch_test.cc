// `rotslam batch`: good and bad sequences together, again, collected, and as an array job.

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
#include <sys/wait.h>
#include <unistd.h>

#include "output/metrics.h"
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
                             turn + "\n  command: rotations\n  ground_truth: " + turn +
                             "/groundtruth_tum.txt\n");
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
  EXPECT_EQ(Written(Out() / "walk/summary.json"), walk_written);
  EXPECT_NE(Written(Out() / "broken/batch.json"), broken_written);

  // A run that lost its end, and one with other options, are not done.
  fs::resize_file(Out() / "gimbal/summary.json", 100);
  const fs::path changed = List("{krot: {start: linear}}");
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
  EXPECT_EQ(ReadSummary(Out() / "walk")["options"]["krot"]["start"], "linear");
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

TEST_F(Batch, RunsAsAnArrayJob) {
  // A folder that a careless script would take apart.
  const fs::path strange = folder_.path() / "it's $HOME; \"%a\" `x`";
  fs::create_directory(strange);
  const fs::path list = strange / "list.yaml";
  fs::copy_file(List(), list);
  const fs::path out = strange / "out";
  const std::string script = (strange / "job.sh").string();
  const CommandResult written =
      Rotslam({"batch", list.string(), "--out", out.string(), "--slurm", script, "--jobs", "2"});
  ASSERT_EQ(written.exit_code, 0) << written.error;
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
  EXPECT_THAT(Lines(csv), testing::SizeIs(4));
  EXPECT_THAT(csv, AllOf(HasSubstr("\nwalk,24,1.0000,"), HasSubstr("\nbroken,,,")));
}

}  // namespace
}  // namespace rotslam
