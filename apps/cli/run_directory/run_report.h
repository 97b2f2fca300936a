#pragma once

#include <filesystem>

#include "apps/cli/terminal/common_flags.h"
#include "apps/cli/terminal/progress.h"

namespace rotslam {

struct TruthSource;

/// Writes report.html into the folder of a run that has just ended. A report that fails is a
/// warning: the run's results are there.
void WriteReportOfRun(const std::filesystem::path& directory,
                      const CommonFlags& flags,
                      Progress& progress);

/// Adds the flags that name the ground truth of `report` and `plot`.
void AddTruthFlags(CLI::App& command, TruthSource& truth);

/// `run` and `rotations` write one; `--no-report` leaves it out.
void AddReportFlag(CLI::App& command, bool& use_report);

}  // namespace rotslam
