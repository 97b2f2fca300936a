#pragma once

#include <filesystem>
#include <string>

#include "apps/cli/run_directory/checkpoint.h"
#include "apps/slam/orientations.h"

namespace rotslam {

/// Makes the folder for a run's results and proves that it can be written, before hours of work.
/// What a killed run was about to publish there is published. Throws std::runtime_error with path
/// and reason.
std::filesystem::path PrepareRunDirectory(const std::string& out);

/// What the terminal says of a run that Ctrl-C has ended: what WriteOrientations has left.
std::string DescribeInterrupted(const std::filesystem::path& directory,
                                const Orientations& orientations,
                                const Checkpoint& checkpoint);

}  // namespace rotslam
