#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "output/trajectory/metrics.h"
#include "output/trajectory/trajectory_match.h"

namespace rotslam {

/// How far an estimate is from the truth, and what was assumed about the two.
struct Comparison {
  TrajectoryMetrics metrics;
  std::vector<std::string> notes;  // one line each
};

/// How far `estimate` is from `ground_truth` once MatchTrajectories has brought them together.
/// Throws std::runtime_error, in one line, when fewer than three poses have ground truth.
Comparison CompareTrajectories(const NamedTrajectory& ground_truth,
                               const NamedTrajectory& estimate,
                               const MatchOptions& options);

/// The same for two files.
/// @param times  timestamps of files that have none, as in ReadTrajectoryFile.
/// Throws what ReadTrajectoryFile throws besides.
Comparison CompareTrajectoryFiles(const std::filesystem::path& ground_truth,
                                  const std::filesystem::path& estimate,
                                  const std::optional<std::filesystem::path>& times,
                                  const MatchOptions& options);

/// Share of the images whose estimated pose has ground truth, to four decimals; nullopt for none.
std::optional<double> Coverage(const TrajectoryMetrics& metrics, int num_images);

/// The metrics as `rotslam eval --json` prints them; null where a metric is not defined, "notes"
/// only where there are any.
nlohmann::ordered_json MetricsJson(const Comparison& comparison, int num_images);

}  // namespace rotslam
