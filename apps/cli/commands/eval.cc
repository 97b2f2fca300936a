#include <cstdio>
#include <memory>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "apps/cli/command.h"
#include "apps/cli/input/config.h"
#include "apps/cli/input/evaluation.h"
#include "output/trajectory/metrics.h"
#include "output/trajectory/trajectory_form.h"

namespace rotslam {
namespace {

struct EvalFlags {
  CommonFlags common;
  std::string ground_truth;
  std::string estimate;
  std::string times;
  int num_images = 0;
  std::optional<double> max_gap_s;
  double time_offset_s = 0.0;
  bool align_axes = false;
  bool as_is = false;
  bool json = false;
};

void PrintRow(const char* name, const std::string& value, const char* meaning) {
  std::printf("%-14s %12s  %s\n", name, value.c_str(), meaning);
}

std::string Fixed(const std::optional<double>& value, int decimals) {
  if (!value) return "-";
  char text[400];
  std::snprintf(text, sizeof(text), "%.*f", decimals, *value);
  return text;
}

void PrintTable(const TrajectoryMetrics& metrics, int num_images) {
  PrintRow("poses", std::to_string(metrics.num_poses), "estimated poses that have ground truth");
  if (const auto coverage = Coverage(metrics, num_images)) {
    PrintRow("coverage", Fixed(100.0 * *coverage, 2), "% of the images");
  }
  PrintRow("RPE_1", Fixed(metrics.rpe1_deg, 4), "deg, root mean square from pose to pose");
  PrintRow("  median", Fixed(metrics.rpe1_median_deg, 4), "deg");
  PrintRow("  90 percent", Fixed(metrics.rpe1_p90_deg, 4), "deg");
  PrintRow("  largest", Fixed(metrics.rpe1_max_deg, 4), "deg");
  PrintRow("RPE_n", Fixed(metrics.rpen_deg, 4), "deg, mean over all steps");
  PrintRow("r_err",
           Fixed(metrics.r_err_deg_per_100m, 4),
           metrics.r_err_deg_per_100m ? "deg per 100 m, KITTI" : "the path is shorter than 100 m");
  PrintRow("ATE",
           Fixed(metrics.ate_m, 4),
           metrics.ate_m ? "m, after the best similarity" : "no positions to compare");
  if (metrics.scale) PrintRow("scale", Fixed(metrics.scale, 6), "ground truth / estimate");
  PrintRow("path length", Fixed(metrics.path_length_m, 2), "m, ground truth");
}

std::string TrajectoryFormNames() {
  std::string names;
  for (const TrajectoryForm& form : TrajectoryForms()) {
    names += (names.empty() ? "" : ", ") + form.name;
  }
  return names;
}

int Eval(const EvalFlags& flags) {
  MatchOptions options;
  options.metrics.num_threads = flags.common.NumThreads();
  if (!flags.common.config.empty()) LoadOptionsYaml(flags.common.config, options.metrics);
  if (flags.max_gap_s) options.metrics.max_gap_s = *flags.max_gap_s;
  options.align_axes = flags.align_axes;
  options.as_is = flags.as_is;
  options.time_offset_s = flags.time_offset_s;
  std::optional<std::filesystem::path> times;
  if (!flags.times.empty()) times = flags.times;
  const Comparison comparison =
      CompareTrajectoryFiles(flags.ground_truth, flags.estimate, times, options);
  if (flags.json) {
    std::printf("%s\n",
                MetricsJson(comparison, flags.num_images)
                    .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)
                    .c_str());
  } else {
    for (const std::string& note : comparison.notes) std::printf("note: %s\n", note.c_str());
    PrintTable(comparison.metrics, flags.num_images);
  }
  return 0;
}

}  // namespace

void AddEvalCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<EvalFlags>();
  CLI::App* command = app.add_subcommand(
      "eval",
      "Compare a trajectory with the ground truth (TUM, KITTI, EuRoC and others in any mix)");
  command
      ->add_option("ground_truth",
                   flags->ground_truth,
                   "Ground truth, camera->world: " + TrajectoryFormNames())
      ->required();
  command->add_option("estimate", flags->estimate, "Estimate, camera->world")->required();
  command->add_option("--times",
                      flags->times,
                      "Timestamps of files without times, one a line (default: the pose number)");
  command
      ->add_option("--images", flags->num_images, "Images of the sequence, to report the coverage")
      ->check(AtLeastZero());
  command
      ->add_option("--max-gap",
                   flags->max_gap_s,
                   "Largest gap in the ground truth to interpolate over, s (default: 0.2)")
      ->check(AtLeastZero());
  command->add_flag("--align-axes",
                    flags->align_axes,
                    "Take out a constant rotation between the axes (body and camera, say)");
  command->add_flag("--as-is",
                    flags->as_is,
                    "Take both files as they stand, even if one fits far better as world->camera "
                    "or with qw first");
  command->add_option(
      "--time-offset", flags->time_offset_s, "Added to the times of the estimate, s (default: 0)");
  command->add_flag("--json", flags->json, "Print one line of JSON");
  AddCommonFlags(*command, flags->common);
  command->footer("Example: rotslam eval groundtruth.txt runs/mine/trajectory_tum.txt");
  command->callback([flags, &action] { action = [flags] { return Eval(*flags); }; });
}

}  // namespace rotslam
