#include <chrono>
#include <memory>
#include <string>
#include <utility>

#include "apps/cli/command.h"
#include "apps/cli/commands/track_input.h"
#include "apps/cli/input/open_input.h"
#include "apps/cli/input/run_options.h"
#include "apps/cli/run_directory/checkpoint.h"
#include "apps/cli/run_directory/run_directory.h"
#include "apps/cli/run_directory/run_report.h"
#include "apps/cli/run_directory/unfinished.h"
#include "apps/cli/terminal/interruption.h"
#include "apps/cli/terminal/progress.h"
#include "apps/cli/terminal/slam_progress.h"
#include "output/files/option_list.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

struct RotationsFlags {
  CommonFlags common;
  InputFlags input;
  CheckpointFlags checkpoint;
  std::string averaging;  // empty: as the configuration says
  bool use_report = true;
};

int FindAndWriteRotations(const RotationsFlags& flags) {
  const auto start = std::chrono::steady_clock::now();
  Interruption interruption;
  Progress progress(flags.common);
  // The whole pipeline's options, so that one configuration file serves `run` and `rotations`.
  RunOptions options = ReadRunOptions(flags.common, flags.input);
  if (!flags.averaging.empty()) ChoiceField(options.rotodom.averaging.mode).Assign(flags.averaging);

  Input input = OpenInput(
      flags.input, options.sequence, [&](const std::string& line) { progress.Say(line); });
  auto vocabulary = OpenVocabulary(flags.input);
  const std::filesystem::path directory = PrepareRunDirectory(flags.input.out);
  RefineGuess(options, interruption, progress, input);
  const double guess_s = SecondsSince(start);
  Checkpoint checkpoint(directory,
                        flags.checkpoint,
                        IdentityOf("rotations", input, flags.input, options, flags.common.seed),
                        progress);
  SlamProgress observer(options, interruption, progress);
  const Orientations orientations =
      TrackInput(options, std::move(vocabulary), false, observer, checkpoint, input);
  const UnfinishedOutputs outputs(directory);
  WriteOrientations(outputs.folder(), orientations);
  RunSummary summary = StartSummary("rotations", input, orientations, DescribeOptions(options));
  if (input.guess) summary.seconds.push_back({"focal_guess", guess_s});
  summary.seconds.push_back({"total", SecondsSince(start)});
  WriteSummary(outputs.folder() / "summary.json", summary);
  outputs.Publish();
  if (input.guess) progress.Warn(WarningOf(*input.guess, input.camera));
  if (orientations.interrupted) {
    progress.Warn(DescribeInterrupted(directory, orientations, checkpoint));
    return Interruption::kExitCode;
  }
  if (flags.use_report) WriteReportOfRun(directory, flags.common, progress);
  checkpoint.Remove();
  progress.Say("wrote " + (directory / "rotations_tum.txt").string() +
               ", rotations.csv, loops.csv, view_graph.g2o, summary.json" +
               (flags.use_report ? ", report.html" : ""));
  return interruption.IsRequested() ? Interruption::kExitCode : 0;
}

}  // namespace

void AddRotationsCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<RotationsFlags>();
  CLI::App* command = app.add_subcommand(
      "rotations",
      "Every frame's orientation from a sequence, without positions (rotational odometry)");
  AddInputFlags(*command, flags->input);
  AddCheckpointFlags(*command, flags->checkpoint);
  command
      ->add_option("--averaging",
                   flags->averaging,
                   "What is averaged at every frame: off (orientations are chained), window (the "
                   "newest ones; default) or global (all; the time grows with the sequence)")
      ->check(CLI::IsMember({"off", "window", "global"}));
  AddReportFlag(*command, flags->use_report);
  AddCommonFlags(*command, flags->common);
  command->footer("Example: rotslam rotations footage.mp4 --camera phone.yaml --out runs/footage");
  command->callback(
      [flags, &action] { action = [flags] { return FindAndWriteRotations(*flags); }; });
}

}  // namespace rotslam
