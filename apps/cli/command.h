#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include <CLI/CLI.hpp>

namespace rotslam {

/// What every subcommand takes.
struct CommonFlags {
  int threads = 0;  // 0: all cores; the output does not depend on it
  std::uint64_t seed = 1;
  std::string config;  // YAML file that overrides option defaults; empty: none
  bool quiet = false;
  bool verbose = false;
  std::string log;  // file for all that --verbose says, with times; empty: none

  /// `threads`, with 0 replaced by the number of cores.
  int NumThreads() const;
};

/// The work of the subcommand that was chosen; its value is the program's exit code. World and
/// contract errors leave it as exceptions, which main turns into one line.
using Action = std::function<int()>;

/// Checks of option values, with messages for people.
CLI::Validator AtLeastZero();
CLI::Validator AboveZero();

void AddCommonFlags(CLI::App& command, CommonFlags& flags);

// One file per subcommand. Each adds its subcommand to `app` and sets `action` once it is parsed.
void AddRunCommand(CLI::App& app, Action& action);
void AddRotationsCommand(CLI::App& app, Action& action);
void AddSolveCommand(CLI::App& app, Action& action);
void AddSimulateCommand(CLI::App& app, Action& action);
void AddAverageCommand(CLI::App& app, Action& action);
void AddBatchCommand(CLI::App& app, Action& action);
void AddEvalCommand(CLI::App& app, Action& action);
void AddExportCommand(CLI::App& app, Action& action);
void AddPanoramaCommand(CLI::App& app, Action& action);
void AddInspectCommand(CLI::App& app, Action& action);
void AddReportCommand(CLI::App& app, Action& action);
void AddPlotCommand(CLI::App& app, Action& action);
void AddVocabularyCommand(CLI::App& app, Action& action);
void AddCalibrateCommand(CLI::App& app, Action& action);
void AddCompletionCommand(CLI::App& app, Action& action);
void AddManCommand(CLI::App& app, Action& action);

}  // namespace rotslam
