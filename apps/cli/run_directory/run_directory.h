#pragma once

#include <filesystem>
#include <string>

#include "apps/cli/run_directory/checkpoint.h"
#include "apps/slam/orientations.h"

namespace rotslam {

/// Makes the folder for a run's results, proves that it can be written, before hours of work, and
/// publishes the files that a killed run was publishing there. Throws std::runtime_error with path
/// and reason.
std::filesystem::path PrepareRunDirectory(const std::string& out);

/// The message for a run that Ctrl-C has ended: it names the files that WriteOrientations has left.
std::string DescribeInterrupted(const std::filesystem::path& directory,
                                const Orientations& orientations,
                                const Checkpoint& checkpoint);

}  // namespace rotslam
