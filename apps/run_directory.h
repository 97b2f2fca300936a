#pragma once

#include <filesystem>

#include "apps/orientations.h"
#include "output/summary.h"

namespace rotslam {

/// Makes the folder for a run's results and proves that it can be written, before hours of work.
/// Throws std::runtime_error with path and reason.
std::filesystem::path PrepareRunDirectory(const std::string& out);

/// rotations_tum.txt and view_graph.g2o.
void WriteOrientations(const std::filesystem::path& directory, const Orientations& orientations);

/// The parts of summary.json that `run` and `rotations` share.
RunSummary StartSummary(const std::string& command,
                        const Input& input,
                        const Orientations& orientations,
                        std::vector<OptionEntry> options);

}  // namespace rotslam
