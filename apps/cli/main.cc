#include <csignal>
#include <exception>
#include <string>

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <glog/logging.h>
#include <opencv2/core/utility.hpp>

#include "apps/cli/command.h"
#include "apps/cli/terminal/interruption.h"
#include "apps/cli/terminal/progress.h"
#include "apps/cli/versions.h"

namespace rotslam {
namespace {

// Stages take and give back arrays of some 20 MB many times over, bundle adjustment in every round.
// By default the allocator returns each to the system, which then makes every page anew: a tenth of
// the time of known rotation and bundle adjustment. Before any thread runs.
void KeepFreedMemory() {
#ifdef __GLIBC__
  mallopt(M_MMAP_THRESHOLD, 256 << 20);  // NOLINT(concurrency-mt-unsafe)
  mallopt(M_TRIM_THRESHOLD, 512 << 20);  // NOLINT(concurrency-mt-unsafe)
#endif
}

// The line is not one of ours: says what is wrong with it and where to read what it may be.
int RefuseCommandLine(const CLI::App& app, const CLI::ParseError& error, int argc, char** argv) {
  const auto chosen = app.get_subcommands();
  if (!chosen.empty()) {
    const std::string name = chosen.front()->get_name();
    PrintError(name + ": " + error.what() + "; see rotslam " + name + " --help");
  } else if (argc > 1 && argv[1][0] != '-') {
    std::string names;
    for (const CLI::App* command : app.get_subcommands(nullptr)) {
      names += (names.empty() ? "" : ", ") + command->get_name();
    }
    PrintError(std::string("no command is called ") + argv[1] + "; there are " + names);
  } else {
    PrintError(std::string(error.what()) + "; see rotslam --help");
  }
  return 2;
}

// The same heading with every version of CLI11.
void NameGroups(CLI::App& app) {
  for (CLI::App* command : app.get_subcommands({})) {
    command->group("Commands");
    NameGroups(*command);
  }
}

}  // namespace
}  // namespace rotslam

int main(int argc, char** argv) {
  try {
    CLI::App app("rotslam: camera path and sparse map from one calibrated video, rotations first",
                 "rotslam");
    app.require_subcommand(1);
    rotslam::KeepFreedMemory();
    // A file beyond a limit on sizes is a disk that is full: an error of the write, not the end.
    std::signal(SIGXFSZ, SIG_IGN);
    // Ceres tells of steps and solves that fail, also of trials that may; what matters is in our
    // own results.
    FLAGS_minloglevel = google::GLOG_FATAL;
    // Our stages bring their own threads; OpenCV's pool under them only gets in the way.
    cv::setNumThreads(1);
    rotslam::Action action;
    rotslam::AddRunCommand(app, action);
    rotslam::AddRotationsCommand(app, action);
    rotslam::AddLiveCommand(app, action);
    rotslam::AddInspectCommand(app, action);
    rotslam::AddSolveCommand(app, action);
    rotslam::AddExportCommand(app, action);
    rotslam::AddAverageCommand(app, action);
    rotslam::AddEvalCommand(app, action);
    rotslam::AddSimulateCommand(app, action);
    rotslam::AddCheckCommand(app, action);
    rotslam::AddReportCommand(app, action);
    rotslam::AddPlotCommand(app, action);
    rotslam::AddPanoramaCommand(app, action);
    rotslam::AddVocabularyCommand(app, action);
    rotslam::AddBatchCommand(app, action);
    rotslam::AddCalibrateCommand(app, action);
    rotslam::AddCompletionCommand(app, action);
    rotslam::AddManCommand(app, action);
    rotslam::NameGroups(app);
    app.set_version_flag("--version", rotslam::VersionText(), "Print versions and end");
    try {
      app.parse(argc, argv);
    } catch (const CLI::Success& help) {
      return app.exit(help);
    } catch (const CLI::ParseError& error) {
      return rotslam::RefuseCommandLine(app, error, argc, argv);
    }
    return action();
  } catch (const rotslam::InterruptedError& error) {
    rotslam::PrintError(error.what());
    return rotslam::Interruption::kExitCode;
  } catch (const std::exception& error) {
    rotslam::PrintError(error.what());
    return 1;
  }
}
