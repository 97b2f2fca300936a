#pragma once

#include <functional>

#include <CLI/CLI.hpp>

#include "apps/cli/terminal/common_flags.h"

namespace rotslam {

/// The work of the subcommand that was chosen; its value is the program's exit code. World and
/// contract errors leave it as exceptions, which main turns into one line.
using Action = std::function<int()>;

// One file per subcommand. Each adds its subcommand to `app` and sets `action` once it is parsed.
void AddRunCommand(CLI::App& app, Action& action);
void AddLiveCommand(CLI::App& app, Action& action);
void AddRotationsCommand(CLI::App& app, Action& action);
void AddSolveCommand(CLI::App& app, Action& action);
void AddSimulateCommand(CLI::App& app, Action& action);
void AddAverageCommand(CLI::App& app, Action& action);
void AddBatchCommand(CLI::App& app, Action& action);
void AddEvalCommand(CLI::App& app, Action& action);
void AddExportCommand(CLI::App& app, Action& action);
void AddPanoramaCommand(CLI::App& app, Action& action);
void AddInspectCommand(CLI::App& app, Action& action);
void AddCheckCommand(CLI::App& app, Action& action);
void AddReportCommand(CLI::App& app, Action& action);
void AddPlotCommand(CLI::App& app, Action& action);
void AddVocabularyCommand(CLI::App& app, Action& action);
void AddCalibrateCommand(CLI::App& app, Action& action);
void AddCompletionCommand(CLI::App& app, Action& action);
void AddManCommand(CLI::App& app, Action& action);

}  // namespace rotslam
