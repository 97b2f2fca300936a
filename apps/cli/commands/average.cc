#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "apps/cli/command.h"
#include "apps/cli/input/config.h"
#include "output/graph/rotation_list_file.h"
#include "rotodom/averaging/certificate.h"
#include "rotodom/averaging/global_averaging.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

struct AverageFlags {
  CommonFlags common;
  std::string graph;
  std::string out;
  double sigma_deg = 1.0;
  bool use_start = false;
  bool certify = false;
};

void PrintRow(const char* name, const std::string& value, const std::string& meaning) {
  std::printf("%-14s %14s  %s\n", name, value.c_str(), meaning.c_str());
}

std::string Text(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof(text), format, value);
  return text;
}

void PrintAngles(std::vector<double> angle_rad) {
  std::sort(angle_rad.begin(), angle_rad.end());
  const double last = static_cast<double>(angle_rad.size() - 1);
  const auto at = [&](double share) {
    return Text("%.4f", kDegFromRad * angle_rad[static_cast<std::size_t>(share * last)]);
  };
  PrintRow("angle", at(0.5), "deg between edges and result, median");
  PrintRow("  90 percent", at(0.9), "deg");
  PrintRow("  95 percent", at(0.95), "deg");
  PrintRow("  99 percent", at(0.99), "deg");
  PrintRow("  largest", at(1.0), "deg");
}

void PrintResult(const GlobalAveragingResult& result, double read_s, double average_s) {
  const std::size_t num_edges = result.angle_rad.size();
  PrintRow("views", std::to_string(result.cam_from_world.size()), "with an edge");
  PrintRow("edges", std::to_string(num_edges), "");
  const int largest =
      *std::max_element(result.component_sizes.begin(), result.component_sizes.end());
  PrintRow("components",
           std::to_string(result.component_sizes.size()),
           "the largest has " + std::to_string(largest) + " views");
  PrintAngles(result.angle_rad);
  PrintRow("inliers",
           Text("%.2f", 100.0 * result.num_inliers / static_cast<double>(num_edges)),
           "% of the edges");
  PrintRow("cost", Text("%.8g", result.cost), "robust, in squared standard deviations");
  PrintRow("iterations",
           std::to_string(result.iterations),
           result.has_converged ? "converged" : "not converged");
  PrintRow("seconds", Text("%.3f", average_s), Text("and %.3f to read", read_s));
}

// Of the inliers, with weights one by their mean variance.
void PrintCertificate(const RotationList& list,
                      const GlobalAveragingResult& result,
                      const GlobalAveragingOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  std::vector<double> weights(list.edges.size(), 0.0);
  for (std::size_t k = 0; k < weights.size(); ++k) {
    if (result.sigmas[k] > options.loss_sigmas) continue;
    weights[k] = 3.0 / list.edges[k].covariance.trace();
  }
  const AveragingCertificate certificate =
      CertifyAveraging(list.edges, weights, result.cam_from_world);
  PrintRow("chordal cost",
           Text("%.10g", certificate.cost),
           "of the inliers, least squares, isotropic weights; after refining");
  PrintRow("  bound", Text("%.10g", certificate.cost_bound), "no orientations cost less");
  PrintRow("  gap", Text("%.3g", certificate.RelativeGap()), "relative");
  PrintRow("  eigenvalue",
           Text("%.3g", certificate.smallest_eigenvalue),
           "the dual matrix' smallest is at least this");
  PrintRow("  seconds", Text("%.3f", SecondsSince(start)), "");
}

int Average(const AverageFlags& flags) {
  GlobalAveragingOptions options;
  if (!flags.common.config.empty()) LoadOptionsYaml(flags.common.config, options);
  options.seed = flags.common.seed;
  const auto start = std::chrono::steady_clock::now();
  const RotationList list = ReadRotationList(flags.graph, flags.sigma_deg * kRadFromDeg);
  const double read_s = SecondsSince(start);

  GlobalAveragingProblem problem;
  problem.edges = list.edges;
  problem.cam_from_world = list.cam_from_world;
  problem.held_views.insert(list.fixed.begin(), list.fixed.end());
  problem.use_start = flags.use_start;
  const auto averaging_start = std::chrono::steady_clock::now();
  const GlobalAveragingResult result = AverageGlobally(problem, options, flags.common.NumThreads());
  const double average_s = SecondsSince(averaging_start);

  // Vertices without an edge stay as they were.
  RotationMap cam_from_world = result.cam_from_world;
  cam_from_world.insert(list.cam_from_world.begin(), list.cam_from_world.end());
  WriteRotationList(flags.out, list, cam_from_world);
  if (flags.common.quiet) return 0;
  PrintRow("form", list.form, "");
  for (const std::string& note : list.notes) std::printf("note: %s\n", note.c_str());
  PrintResult(result, read_s, average_s);
  if (flags.certify) PrintCertificate(list, result, options);
  return 0;
}

}  // namespace

void AddAverageCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<AverageFlags>();
  CLI::App* command = app.add_subcommand(
      "average", "Orientations that agree best with a graph of relative rotations, wrong ones too");
  command
      ->add_option("graph",
                   flags->graph,
                   "g2o (EDGE_SE3:QUAT, FIX) or TORO (EDGE3) pose graph, or lines "
                   "'i j qx qy qz qw' or 'i j' and a 3x3 matrix by rows: x_j = R x_i")
      ->required();
  command
      ->add_option("--out",
                   flags->out,
                   "Result: a pose graph (.g2o) or lines 'id qx qy qz qw', camera from world")
      ->required();
  command
      ->add_option("--sigma",
                   flags->sigma_deg,
                   "Standard deviation of edges whose lines say none, deg (default: 1)")
      ->check(AboveZero());
  command->add_flag("--start", flags->use_start, "Start from the graph's vertices");
  command->add_flag(
      "--certify", flags->certify, "Bound the distance of the inliers' cost from its minimum");
  AddCommonFlags(*command, flags->common);
  command->footer("Example: rotslam average sphere2500.g2o --out averaged.g2o --certify");
  command->callback([flags, &action] { action = [flags] { return Average(*flags); }; });
}

}  // namespace rotslam
