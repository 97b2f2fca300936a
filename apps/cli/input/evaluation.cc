#include "apps/cli/input/evaluation.h"

#include <cmath>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "output/trajectory/trajectory.h"

namespace rotslam {

Comparison CompareTrajectories(const NamedTrajectory& ground_truth,
                               const NamedTrajectory& estimate,
                               const MatchOptions& options) {
  MatchedTrajectories matched = MatchTrajectories(ground_truth, estimate, options);
  return {ComputeMetrics(matched.pairs, options.metrics), std::move(matched.notes)};
}

Comparison CompareTrajectoryFiles(const std::filesystem::path& ground_truth,
                                  const std::filesystem::path& estimate,
                                  const std::optional<std::filesystem::path>& times,
                                  const MatchOptions& options) {
  return CompareTrajectories({ReadTrajectoryFile(ground_truth, times), ground_truth.string()},
                             {ReadTrajectoryFile(estimate, times), estimate.string()},
                             options);
}

std::optional<double> Coverage(const TrajectoryMetrics& metrics, int num_images) {
  if (num_images == 0) return std::nullopt;
  return std::round(1e4 * metrics.num_poses / num_images) / 1e4;
}

nlohmann::ordered_json MetricsJson(const Comparison& comparison, int num_images) {
  const TrajectoryMetrics& metrics = comparison.metrics;
  const auto or_null = [](const std::optional<double>& value) {
    return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json();
  };
  nlohmann::ordered_json json = {{"n", metrics.num_poses},
                                 {"images", num_images},
                                 {"coverage", or_null(Coverage(metrics, num_images))},
                                 {"rpe1", metrics.rpe1_deg},
                                 {"rpe1_median", metrics.rpe1_median_deg},
                                 {"rpe1_p90", metrics.rpe1_p90_deg},
                                 {"rpe1_max", metrics.rpe1_max_deg},
                                 {"rpen", metrics.rpen_deg},
                                 {"r_err", or_null(metrics.r_err_deg_per_100m)},
                                 {"ate", or_null(metrics.ate_m)},
                                 {"scale", or_null(metrics.scale)},
                                 {"path_length", metrics.path_length_m}};
  if (!comparison.notes.empty()) json["notes"] = comparison.notes;
  return json;
}

}  // namespace rotslam
