#include <cstdio>
#include <exception>
#include <memory>
#include <string>

#include "apps/cli/command.h"
#include "apps/cli/input/config.h"
#include "apps/cli/run_directory/run_report.h"
#include "apps/report/page.h"
#include "apps/report/run_data.h"
#include "output/files/atomic_file.h"

namespace rotslam {
namespace {

struct ReportFlags {
  CommonFlags common;
  std::string run;
  std::string out;
  TruthSource truth;
  ReportOptions report;
};

MetricsOptions MetricsOf(const CommonFlags& common) {
  MetricsOptions options;
  if (!common.config.empty()) LoadOptionsYaml(common.config, options);
  options.num_threads = common.NumThreads();
  return options;
}

int WriteReport(const ReportFlags& flags) {
  RunData run = ReadRunData(flags.run);
  AddTruth(flags.truth, MetricsOf(flags.common), run);
  const std::filesystem::path out =
      flags.out.empty() ? run.directory / "report.html" : std::filesystem::path(flags.out);
  const std::string page = ReportPage(run, flags.report);
  ReplaceFile(out, page);
  if (!flags.common.quiet) {
    if (run.truth) {
      for (const std::string& note : run.truth->notes) std::printf("note: %s\n", note.c_str());
    }
    std::printf("wrote %s, %.1f MB\n", out.c_str(), 1e-6 * static_cast<double>(page.size()));
  }
  return 0;
}

}  // namespace

void WriteReportOfRun(const std::filesystem::path& directory,
                      const CommonFlags& flags,
                      Progress& progress) {
  try {
    MetricsOptions metrics;
    metrics.num_threads = flags.NumThreads();
    RunData run = ReadRunData(directory);
    AddTruth({}, metrics, run);
    ReplaceFile(directory / "report.html", ReportPage(run, {}));
  } catch (const std::exception& error) {
    progress.Warn(std::string("no report: ") + error.what());
  }
}

void AddTruthFlags(CLI::App& command, TruthSource& truth) {
  command.add_option("--ground-truth",
                     truth.file,
                     "File or folder of poses, camera->world (default: the one beside the images)");
  command.add_option(
      "--times",
      truth.times,
      "Timestamps of a file without times, one a line (default: times.txt beside it)");
  command.add_flag("--align-axes",
                   truth.align_axes,
                   "Take out a constant rotation between its axes and the camera's");
}

void AddReportFlag(CLI::App& command, bool& use_report) {
  command.add_flag("--report,!--no-report",
                   use_report,
                   "Write report.html, a page to look at the result in a browser (default)");
}

void AddReportCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<ReportFlags>();
  CLI::App* command = app.add_subcommand(
      "report", "One page to look at a run in a browser: map, curves, figures, images");
  command->add_option("run", flags->run, "Folder that `run` or `rotations` has written to")
      ->required();
  command->add_option("--out", flags->out, "Page to write (default: report.html in that folder)");
  AddTruthFlags(*command, flags->truth);
  command->add_option(
      "--sequence", flags->report.sequence, "Where the images are now, if they moved");
  command
      ->add_option("--images",
                   flags->report.thumbnails.max_count,
                   "Show at most so many small images; 0: none (default: 160)")
      ->check(AtLeastZero());
  AddCommonFlags(*command, flags->common);
  command->footer("Example: rotslam report runs/kitti00 --ground-truth poses.txt");
  command->callback([flags, &action] { action = [flags] { return WriteReport(*flags); }; });
}

}  // namespace rotslam
