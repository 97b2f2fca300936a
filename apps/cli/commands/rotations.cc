#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "apps/cli/command.h"
#include "apps/cli/commands/track_input.h"
#include "apps/cli/paper/paper_rotations.h"
#include "apps/cli/run_directory/run_directory.h"
#include "apps/cli/run_directory/run_report.h"
#include "apps/cli/run_directory/summary_parts.h"
#include "output/files/option_list.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

struct RotationsFlags {
  TrackFlags track;
  std::string method = "ours";
  std::string averaging;  // empty: as the configuration says
  bool use_report = true;
};

Orientations FindByPaper(TrackedInput& tracked, const OrientationInputs& inputs) {
  return FindPaperOrientations(tracked.frames,
                               tracked.working.Reduced(tracked.input.camera),
                               tracked.options,
                               inputs,
                               tracked.observer);
}

int FindAndWriteRotations(const RotationsFlags& flags) {
  const bool is_paper = flags.method == "paper";
  if (is_paper && flags.track.checkpoint.resume) {
    throw std::runtime_error("--method paper writes no checkpoints, so --resume finds none");
  }
  // The whole pipeline's options, so that one configuration file serves `run` and `rotations`.
  RunOptions options = is_paper ? ReadPaperOptions(flags.track.common, flags.track.input)
                                : ReadRunOptions(flags.track.common, flags.track.input);
  if (!flags.averaging.empty()) ChoiceField(options.rotodom.averaging.mode).Assign(flags.averaging);
  TrackedInput tracked("rotations",
                       flags.track,
                       std::move(options),
                       false,
                       is_paper ? FindByPaper : TrackedInput::Tracking());
  const std::filesystem::path& directory = tracked.directory;
  const Input& input = tracked.input;
  const Orientations& orientations = tracked.orientations;
  Progress& progress = tracked.progress;

  tracked.ToOriginalSize();
  std::vector<OptionEntry> option_list = DescribeOptions(tracked.options);
  if (is_paper) option_list.insert(option_list.begin(), {"method", flags.method});
  RunSummary summary = StartSummary("rotations", input, orientations, std::move(option_list));
  if (input.guess) summary.seconds.push_back({"lens", tracked.lens_s});
  summary.seconds.push_back({"total", SecondsSince(tracked.start)});
  WriteSummary(tracked.outputs.folder() / "summary.json", summary);
  tracked.outputs.Publish();
  if (input.guess) progress.Warn(WarningOf(*input.guess, input.camera));
  if (orientations.interrupted) {
    progress.Warn(DescribeInterrupted(directory, orientations, tracked.checkpoint));
    return Interruption::kExitCode;
  }
  if (flags.use_report) WriteReportOfRun(directory, flags.track.common, progress);
  tracked.checkpoint.Remove();
  progress.Say("wrote " + (directory / "rotations_tum.txt").string() +
               ", rotations.csv, loops.csv, view_graph.g2o, summary.json" +
               (flags.use_report ? ", report.html" : ""));
  return tracked.interruption.IsRequested() ? Interruption::kExitCode : 0;
}

}  // namespace

void AddRotationsCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<RotationsFlags>();
  CLI::App* command = app.add_subcommand(
      "rotations",
      "Every frame's orientation from a sequence, without positions (rotational odometry)");
  AddInputFlags(*command, flags->track.input);
  AddCheckpointFlags(*command, flags->track.checkpoint);
  command
      ->add_option(
          "--method",
          flags->method,
          "ours, or paper: the method of Chng et al. (DICTA 2020) as published, to compare "
          "with; slower and without covariances")
      ->check(CLI::IsMember({"ours", "paper"}))
      ->capture_default_str();
  command
      ->add_option("--averaging",
                   flags->averaging,
                   "What is averaged at every frame: off (orientations are chained), window (the "
                   "newest ones; default) or global (all; the time grows with the sequence)")
      ->check(CLI::IsMember({"off", "window", "global"}));
  AddReportFlag(*command, flags->use_report);
  AddCommonFlags(*command, flags->track.common);
  command->footer("Example: rotslam rotations footage.mp4 --camera phone.yaml --out runs/footage");
  command->callback(
      [flags, &action] { action = [flags] { return FindAndWriteRotations(*flags); }; });
}

}  // namespace rotslam
