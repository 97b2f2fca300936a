#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "output/metrics.h"
#include "rotodom/types/trajectory.h"

namespace rotslam {

/// How far `estimate` is from `ground_truth`; their names are for the message.
/// Throws std::runtime_error, in one line, when fewer than three poses have ground truth.
TrajectoryMetrics CompareTrajectories(const Trajectory& ground_truth,
                                      const std::string& ground_truth_name,
                                      const Trajectory& estimate,
                                      const std::string& estimate_name,
                                      const MetricsOptions& options);

/// The same for two files.
/// @param times  timestamps of KITTI files, as in ReadTrajectory.
/// Throws what ReadTrajectory throws besides.
TrajectoryMetrics CompareTrajectoryFiles(const std::filesystem::path& ground_truth,
                                         const std::filesystem::path& estimate,
                                         const std::optional<std::filesystem::path>& times,
                                         const MetricsOptions& options);

/// Share of the images whose estimated pose has ground truth, to four decimals; nullopt for none.
std::optional<double> Coverage(const TrajectoryMetrics& metrics, int num_images);

/// What `rotslam eval --json` prints; null where a metric is not defined.
nlohmann::ordered_json MetricsJson(const TrajectoryMetrics& metrics, int num_images);

}  // namespace rotslam
