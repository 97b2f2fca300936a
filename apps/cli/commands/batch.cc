#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "apps/batch/children.h"
#include "apps/batch/list.h"
#include "apps/batch/record.h"
#include "apps/batch/slurm.h"
#include "apps/batch/table.h"
#include "apps/cli/command.h"
#include "apps/cli/run_directory/checkpoint.h"
#include "apps/cli/run_directory/run_directory.h"
#include "apps/cli/terminal/progress.h"
#include "output/files/atomic_file.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

struct BatchFlags {
  CommonFlags common;
  std::string list;
  std::string out;
  int jobs = 1;
  bool jobs_given = false;
  int only = 0;  // number of the one sequence to run, from 1; 0: all
  bool collect = false;
  std::string slurm;
  std::string slurm_options;
  CheckpointFlags checkpoint;  // `resume` is decided for each sequence

  int ThreadsPerJob() const { return std::max(1, common.NumThreads() / jobs); }
};

// A sequence, where it goes and what is asked of it.
struct Task {
  BatchEntry entry;
  fs::path directory;
  std::string request;
};

std::vector<Task> TasksOf(const BatchFlags& flags) {
  std::vector<Task> tasks;
  for (BatchEntry& entry : ReadBatchList(flags.list, flags.common.config)) {
    Task& task = tasks.emplace_back();
    task.directory = fs::path(flags.out) / entry.name;
    task.request = RequestOf(entry, flags.common.seed);
    task.entry = std::move(entry);
  }
  return tasks;
}

std::vector<std::string> ArgumentsOf(const Task& task, bool resume, const BatchFlags& flags) {
  const BatchEntry& entry = task.entry;
  std::vector<std::string> arguments = {entry.command,
                                        entry.path,
                                        "--out",
                                        task.directory.string(),
                                        "--config",
                                        (task.directory / "batch_options.yaml").string(),
                                        "--threads",
                                        std::to_string(flags.ThreadsPerJob()),
                                        "--seed",
                                        std::to_string(flags.common.seed),
                                        "--checkpoint-every",
                                        std::to_string(flags.checkpoint.every)};
  if (resume) arguments.emplace_back("--resume");
  const auto add = [&](const char* name, const std::string& value) {
    if (value.empty()) return;
    arguments.emplace_back(name);
    arguments.push_back(value);
  };
  add("--camera", entry.camera);
  add("--vocabulary", entry.vocabulary);
  add("--rotations", entry.rotations);
  if (entry.align) arguments.emplace_back("--align");
  return arguments;
}

class Runner {
 public:
  Runner(const std::vector<Task>& tasks, const BatchFlags& flags)
      : tasks_(tasks), flags_(flags), progress_(flags.common) {}

  /// Runs the tasks of these numbers, as many at a time as --jobs says. Gives how many failed.
  int Run(const std::vector<int>& numbers) {
    for (const int k : numbers) {
      children_.Poll();
      if (children_.interrupted()) break;
      if (IsFinished(tasks_[k].directory, tasks_[k].request)) {
        progress_.Say(Name(k) + "done before");
        continue;
      }
      while (children_.num_running() >= flags_.jobs) FinishNext();
      if (children_.interrupted()) break;
      Start(k);
    }
    while (children_.num_running() > 0) FinishNext();
    return num_failed_;
  }

  bool interrupted() const { return children_.interrupted(); }

 private:
  std::string Name(int k) const {
    return "[" + std::to_string(k + 1) + "/" + std::to_string(tasks_.size()) + "] " +
           tasks_[k].entry.name + ": ";
  }

  fs::path LogOf(int k) const { return tasks_[k].directory / "log.txt"; }

  void Start(int k) {
    const Task& task = tasks_[k];
    const bool resume = WasInterrupted(task.directory, task.request);
    BatchRecord record{task.request, std::nullopt, ""};
    if (const auto before = ReadRecord(task.directory); resume && before) {
      const ChildTimes& first = before->earlier;
      const ChildTimes& last = before->running;
      record.earlier = before->end
                           ? ChildTimes{before->end->cpu_s, before->end->wall_s}
                           : ChildTimes{first.cpu_s + last.cpu_s, first.wall_s + last.wall_s};
    }
    try {
      PrepareRunDirectory(task.directory.string());
      // What says that a run is whole must not be left from an older one.
      fs::remove(task.directory / "summary.json");
      ReplaceFile(task.directory / "batch_options.yaml", OptionsFileOf(task.entry));
      WriteRecord(task.directory, record);
      children_.Start(k, ArgumentsOf(task, resume, flags_), LogOf(k));
    } catch (const std::runtime_error& error) {
      progress_.Warn(Name(k) + error.what());
      ++num_failed_;
      return;
    }
    progress_.Say(Name(k) + (resume ? "goes on where it was interrupted" : "started"));
  }

  // Waits for the next one to end.
  void FinishNext() {
    constexpr std::chrono::seconds kNoteEvery(2);
    bool has_ended = false;
    while (!has_ended) {
      if (const auto ended = children_.Wait(kNoteEvery)) {
        Finish(*ended);
        has_ended = true;
      }
      if (std::chrono::steady_clock::now() < noted_ + kNoteEvery) continue;
      NoteTimes();
      noted_ = std::chrono::steady_clock::now();
    }
  }

  // The time until now counts when this process is killed and the next batch goes on.
  void NoteTimes() const {
    for (const auto& [k, times] : children_.TimesSoFar()) {
      auto record = ReadRecord(tasks_[k].directory);
      if (!record) continue;
      record->running = times;
      try {
        WriteRecord(tasks_[k].directory, *record);
      } catch (const std::runtime_error&) {
        // The disk may be full for a while. Finish() says so where it lasts.
      }
    }
  }

  void Finish(const std::pair<int, ChildEnd>& ended) {
    const int k = ended.first;
    BatchRecord record{tasks_[k].request, ended.second, ""};
    if (const auto started = ReadRecord(tasks_[k].directory)) {
      record.earlier = started->earlier;
      record.end->cpu_s += record.earlier.cpu_s;
      record.end->wall_s += record.earlier.wall_s;
    }
    if (record.end->exit_code != 0) record.error = LastErrorLine(LogOf(k));
    WriteRecord(tasks_[k].directory, record);
    if (record.end->exit_code == 0) {
      char seconds[80];
      std::snprintf(seconds,
                    sizeof(seconds),
                    "done in %.1f s, %.1f s of processor time",
                    record.end->wall_s,
                    record.end->cpu_s);
      progress_.Say(Name(k) + seconds);
    } else {
      progress_.Warn(Name(k) + ReasonOf(record) + " (" + LogOf(k).string() + ")");
      ++num_failed_;
    }
  }

  const std::vector<Task>& tasks_;
  const BatchFlags& flags_;
  Progress progress_;
  Children children_;
  std::chrono::steady_clock::time_point noted_ = std::chrono::steady_clock::now();
  int num_failed_ = 0;
};

// Writes the table; gives how many sequences are not done.
int Collect(const std::vector<Task>& tasks, const BatchFlags& flags) {
  std::vector<BatchResult> results;
  results.reserve(tasks.size());
  for (const Task& task : tasks) {
    results.push_back(
        ResultOf(task.entry, task.directory, task.request, flags.common.NumThreads()));
  }
  const fs::path directory = PrepareRunDirectory(flags.out);
  ReplaceFile(directory / "results.csv", ResultsCsv(results));
  ReplaceFile(directory / "results.html",
              ResultsHtml(results, fs::path(flags.list).filename().string()));
  Progress(flags.common).Say("wrote " + (directory / "results.csv").string() + ", results.html");
  return static_cast<int>(
      std::count_if(results.begin(), results.end(), [](const BatchResult& result) {
        return result.status != "done";
      }));
}

int WriteSlurm(const std::vector<Task>& tasks, const BatchFlags& flags) {
  const auto absolute = [](const std::string& path) {
    return path.empty() ? "" : fs::absolute(path).lexically_normal().string();
  };
  SlurmJob job;
  job.program = fs::read_symlink("/proc/self/exe").string();
  job.list = absolute(flags.list);
  job.out = absolute(flags.out);
  job.config = absolute(flags.common.config);
  job.seed = std::to_string(flags.common.seed);
  job.checkpoint_every = flags.checkpoint.every;
  job.num_sequences = static_cast<int>(tasks.size());
  if (flags.jobs_given) job.max_running = flags.jobs;
  job.num_threads = flags.ThreadsPerJob();
  std::istringstream words(flags.slurm_options);
  for (std::string word; words >> word;) {
    if (!word.starts_with('-') && job.options.empty()) {
      throw std::runtime_error(
          "--slurm-options: expected options of sbatch such as "
          "\"--time=2:00:00 --mem=8G\", found \"" +
          word + "\"");
    }
    // A value that stands apart belongs to the option before.
    if (word.starts_with('-')) {
      job.options.push_back(word);
    } else {
      job.options.back() += " " + word;
    }
  }
  ReplaceFile(flags.slurm, SlurmScript(job));
  Progress(flags.common)
      .Say("wrote " + flags.slurm + "; submit it with sbatch, then collect with --collect");
  return 0;
}

int Batch(const BatchFlags& flags) {
  const std::vector<Task> tasks = TasksOf(flags);
  const int num_tasks = static_cast<int>(tasks.size());
  if (!flags.slurm.empty()) return WriteSlurm(tasks, flags);
  if (flags.only > num_tasks) {
    throw std::runtime_error(flags.list + ": has " + std::to_string(num_tasks) +
                             " sequences, there is no number " + std::to_string(flags.only));
  }
  if (!flags.collect) {
    std::vector<int> numbers;
    if (flags.only > 0) numbers.push_back(flags.only - 1);
    for (int k = 0; k < num_tasks && flags.only == 0; ++k) numbers.push_back(k);
    Runner runner(tasks, flags);
    const int num_failed = runner.Run(numbers);
    if (runner.interrupted() && flags.only == 0) Collect(tasks, flags);
    if (runner.interrupted()) return 130;
    // The table is for when all tasks of an array have ended.
    if (flags.only > 0) return num_failed == 0 ? 0 : 1;
  }
  const int num_missing = Collect(tasks, flags);
  if (num_missing == 0) return 0;
  throw std::runtime_error(std::to_string(num_missing) + " of " + std::to_string(num_tasks) +
                           " sequences are not done; see " +
                           (fs::path(flags.out) / "results.html").string());
}

}  // namespace

void AddBatchCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<BatchFlags>();
  CLI::App* command = app.add_subcommand(
      "batch", "Many sequences, one table of results: runs what is not done yet");
  command->add_option("list", flags->list, "YAML list of sequences, see below")->required();
  command->add_option("--out", flags->out, "Folder for the results, one folder in it per sequence")
      ->required();
  CLI::Option* jobs =
      command->add_option("--jobs", flags->jobs, "Sequences at a time; they share --threads")
          ->check(CLI::Range(1, 1024))
          ->capture_default_str();
  CLI::Option* only =
      command->add_option("--only", flags->only, "Run the sequence of this number, from 1")
          ->check(CLI::Range(1, 1000000));
  CLI::Option* collect = command->add_flag(
      "--collect", flags->collect, "Run nothing, write the table of what is done");
  CLI::Option* slurm = command->add_option(
      "--slurm", flags->slurm, "Run nothing, write an array job of Slurm to this file");
  command
      ->add_option("--slurm-options",
                   flags->slurm_options,
                   "Further options of sbatch for --slurm: \"--time=2:00:00 --mem=8G\"")
      ->needs(slurm);
  only->excludes(collect)->excludes(slurm);
  collect->excludes(slurm);
  AddCheckpointEveryFlag(*command, flags->checkpoint);
  AddCommonFlags(*command, flags->common);
  command->footer(
      "A list, of which only the first line must be there; paths count from its folder:\n"
      "  - path: kitti/sequences/00          # folder or video, as `rotslam run` takes it\n"
      "    name: kitti00                     # folder below --out, of a-z A-Z 0-9 . _ -;\n"
      "                                      # else the last part of path\n"
      "    command: run                      # or rotations\n"
      "    camera: calib.txt                 # else what lies with the images; none: as --camera "
      "none\n"
      "    ground_truth: kitti/poses/00.txt  # else what lies with the images\n"
      "    times: kitti/00/times.txt         # timestamps of a KITTI ground truth\n"
      "    rotations: gimbal.csv             # as --rotations of run\n"
      "    align: true                       # as --align\n"
      "    vocabulary: ORBvoc.txt            # as --vocabulary\n"
      "    config: kitti.yaml                # else --config\n"
      "    options: {loop: {use_loops: false}, sequence: {stride: 2}}  # over those of config\n"
      "Each sequence leaves batch.json (how it went) and log.txt beside its results; what is done\n"
      "with the same options is skipped the next time, what was interrupted goes on from its last\n"
      "checkpoint, what failed is tried again from its first frame.\n"
      "Example: rotslam batch kitti.yaml --jobs 4 --out runs/kitti");
  command->callback([flags, jobs, &action] {
    flags->jobs_given = jobs->count() > 0;
    action = [flags] { return Batch(*flags); };
  });
}

}  // namespace rotslam
