#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "apps/command.h"
#include "apps/config.h"
#include "output/metrics.h"
#include "output/trajectory.h"

namespace rotslam {
namespace {

struct EvalFlags {
  CommonFlags common;
  std::string ground_truth;
  std::string estimate;
  std::string times;
  int num_images = 0;
  std::optional<double> max_gap_s;
  bool json = false;
};

// Estimated poses with ground truth per image, to four decimals.
std::optional<double> Coverage(const TrajectoryMetrics& metrics, int num_images) {
  if (num_images == 0) return std::nullopt;
  return std::round(1e4 * metrics.num_poses / num_images) / 1e4;
}

nlohmann::ordered_json OrNull(const std::optional<double>& value) {
  return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json();
}

void PrintJson(const TrajectoryMetrics& metrics, int num_images) {
  const nlohmann::ordered_json json = {{"n", metrics.num_poses},
                                       {"images", num_images},
                                       {"coverage", OrNull(Coverage(metrics, num_images))},
                                       {"rpe1", metrics.rpe1_deg},
                                       {"rpe1_median", metrics.rpe1_median_deg},
                                       {"rpe1_p90", metrics.rpe1_p90_deg},
                                       {"rpe1_max", metrics.rpe1_max_deg},
                                       {"rpen", metrics.rpen_deg},
                                       {"r_err", OrNull(metrics.r_err_deg_per_100m)},
                                       {"ate", OrNull(metrics.ate_m)},
                                       {"scale", OrNull(metrics.scale)},
                                       {"path_length", metrics.path_length_m}};
  std::printf("%s\n", json.dump().c_str());
}

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

int Eval(const EvalFlags& flags) {
  MetricsOptions options;
  options.num_threads = flags.common.NumThreads();
  if (!flags.common.config.empty()) LoadOptionsYaml(flags.common.config, options);
  if (flags.max_gap_s) options.max_gap_s = *flags.max_gap_s;
  std::optional<std::filesystem::path> times;
  if (!flags.times.empty()) times = flags.times;
  const Trajectory ground_truth = ReadTrajectory(flags.ground_truth, times);
  const Trajectory estimate = ReadTrajectory(flags.estimate, times);
  const std::vector<PosePair> pairs = AssociatePoses(ground_truth, estimate, options);
  if (pairs.size() < 3) {
    throw std::runtime_error(flags.estimate + ": only " + std::to_string(pairs.size()) + " of " +
                             std::to_string(estimate.size()) + " poses have ground truth in " +
                             flags.ground_truth +
                             ": do the timestamps agree? KITTI files take theirs from --times");
  }
  const TrajectoryMetrics metrics = ComputeMetrics(pairs, options);
  if (flags.json) {
    PrintJson(metrics, flags.num_images);
  } else {
    PrintTable(metrics, flags.num_images);
  }
  return 0;
}

}  // namespace

void AddEvalCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<EvalFlags>();
  CLI::App* command = app.add_subcommand(
      "eval", "Compare a trajectory with the ground truth (TUM and KITTI files in any mix)");
  command->add_option("ground_truth", flags->ground_truth, "Ground truth, camera->world")
      ->required();
  command->add_option("estimate", flags->estimate, "Estimate, camera->world")->required();
  command->add_option(
      "--times", flags->times, "Timestamps of KITTI files, one a line (default: the pose number)");
  command
      ->add_option("--images", flags->num_images, "Images of the sequence, to report the coverage")
      ->check(AtLeastZero());
  command
      ->add_option("--max-gap",
                   flags->max_gap_s,
                   "Largest gap in the ground truth to interpolate over, s (default: 0.2)")
      ->check(AtLeastZero());
  command->add_flag("--json", flags->json, "Print one line of JSON");
  AddCommonFlags(*command, flags->common);
  command->footer("Example: rotslam eval groundtruth.txt runs/mine/trajectory_tum.txt");
  command->callback([flags, &action] { action = [flags] { return Eval(*flags); }; });
}

}  // namespace rotslam
