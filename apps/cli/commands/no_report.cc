// Stands in for report.cc, plot.cc and live_page.cc in a build without them (ROTSLAM_REPORT=OFF).

#include <stdexcept>

#include "apps/cli/command.h"
#include "apps/cli/live/live_page.h"
#include "apps/cli/run_directory/run_report.h"

namespace rotslam {
namespace {

void AddRefusal(CLI::App& app, const char* name, Action& action) {
  CLI::App* command = app.add_subcommand(name, "Not in this build: configure with ROTSLAM_REPORT");
  command->allow_extras();
  command->callback([&action, name] {
    action = [name]() -> int {
      throw std::runtime_error(std::string(name) +
                               ": this program was built without it; configure the build with "
                               "-DROTSLAM_REPORT=ON");
    };
  });
}

}  // namespace

void WriteReportOfRun(const std::filesystem::path&, const CommonFlags&, Progress&) {}

void AddReportFlag(CLI::App& command, bool& use_report) {
  command.add_flag("--report,!--no-report", use_report, "This build writes none");
}

void AddReportCommand(CLI::App& app, Action& action) { AddRefusal(app, "report", action); }

void AddPlotCommand(CLI::App& app, Action& action) { AddRefusal(app, "plot", action); }

void AddLivePageFlags(CLI::App&, LivePageFlags&) {}

std::function<void(const LiveOutputs::Shown&)> OpenLivePage(const LivePageFlags&,
                                                            const Camera&,
                                                            Progress&) {
  return nullptr;
}

}  // namespace rotslam
