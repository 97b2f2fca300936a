#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "apps/cli/command.h"
#include "apps/cli/input/config.h"
#include "apps/cli/run_directory/run_directory.h"
#include "apps/cli/run_directory/run_report.h"
#include "apps/report/figures/figures.h"
#include "apps/report/run_data.h"
#include "output/files/atomic_file.h"

namespace rotslam {
namespace {

struct PlotFlags {
  CommonFlags common;
  std::string run;
  std::string out;
  TruthSource truth;
  double dots_per_inch = 200.0;
};

int WritePlots(const PlotFlags& flags) {
  MetricsOptions metrics;
  if (!flags.common.config.empty()) LoadOptionsYaml(flags.common.config, metrics);
  metrics.num_threads = flags.common.NumThreads();
  RunData run = ReadRunData(flags.run);
  AddTruth(flags.truth, metrics, run);
  const std::filesystem::path out =
      PrepareRunDirectory(flags.out.empty() ? (run.directory / "plots").string() : flags.out);
  std::string names;
  for (const Figure& figure : MakeFigures(run)) {
    ReplaceFile(out / (figure.name + ".svg"), figure.drawing.Svg());
    ReplaceFile(out / (figure.name + ".png"), figure.drawing.Png(flags.dots_per_inch));
    names += (names.empty() ? "" : ", ") + figure.name;
  }
  if (flags.common.quiet) return 0;
  if (!run.truth_problem.empty()) {
    std::printf("no comparison with the ground truth: %s\n", run.truth_problem.c_str());
  }
  if (run.truth) {
    for (const std::string& note : run.truth->notes) std::printf("note: %s\n", note.c_str());
  }
  if (!run.HasPositions()) std::printf("the run has no positions, so there is no trajectory\n");
  std::printf("wrote %s: %s, each as SVG and PNG\n", out.c_str(), names.c_str());
  return 0;
}

}  // namespace

void AddPlotCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<PlotFlags>();
  CLI::App* command = app.add_subcommand(
      "plot", "Figures of a run for print: trajectory, orientation, errors, runtime (SVG and PNG)");
  command->add_option("run", flags->run, "Folder that `run` or `rotations` has written to")
      ->required();
  command->add_option("--out", flags->out, "Folder for the figures (default: plots/ in the run's)");
  AddTruthFlags(*command, flags->truth);
  command->add_option("--dpi", flags->dots_per_inch, "Of the PNG files (default: 200)")
      ->check(CLI::Range(20.0, 1200.0));
  AddCommonFlags(*command, flags->common);
  command->footer("Example: rotslam plot runs/kitti00 --ground-truth poses.txt --out figures");
  command->callback([flags, &action] { action = [flags] { return WritePlots(*flags); }; });
}

}  // namespace rotslam
