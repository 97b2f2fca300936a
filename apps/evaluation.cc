#include "apps/evaluation.h"

#include <cmath>
#include <stdexcept>
#include <vector>

#include <nlohmann/json.hpp>

#include "output/trajectory.h"

namespace rotslam {

TrajectoryMetrics CompareTrajectories(const Trajectory& ground_truth,
                                      const std::string& ground_truth_name,
                                      const Trajectory& estimate,
                                      const std::string& estimate_name,
                                      const MetricsOptions& options) {
  const std::vector<PosePair> pairs = AssociatePoses(ground_truth, estimate, options);
  if (pairs.size() < 3) {
    throw std::runtime_error(estimate_name + ": only " + std::to_string(pairs.size()) + " of " +
                             std::to_string(estimate.size()) + " poses have ground truth in " +
                             ground_truth_name +
                             ": do the timestamps agree? KITTI files take theirs from --times");
  }
  return ComputeMetrics(pairs, options);
}

TrajectoryMetrics CompareTrajectoryFiles(const std::filesystem::path& ground_truth,
                                         const std::filesystem::path& estimate,
                                         const std::optional<std::filesystem::path>& times,
                                         const MetricsOptions& options) {
  return CompareTrajectories(ReadTrajectory(ground_truth, times),
                             ground_truth.string(),
                             ReadTrajectory(estimate, times),
                             estimate.string(),
                             options);
}

std::optional<double> Coverage(const TrajectoryMetrics& metrics, int num_images) {
  if (num_images == 0) return std::nullopt;
  return std::round(1e4 * metrics.num_poses / num_images) / 1e4;
}

nlohmann::ordered_json MetricsJson(const TrajectoryMetrics& metrics, int num_images) {
  const auto or_null = [](const std::optional<double>& value) {
    return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json();
  };
  return {{"n", metrics.num_poses},
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
}

}  // namespace rotslam
