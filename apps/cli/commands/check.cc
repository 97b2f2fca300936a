#include <cstdio>
#include <memory>
#include <string>

#include "apps/cli/command.h"
#include "apps/report/run_check.h"

namespace rotslam {
namespace {

struct CheckFlags {
  CommonFlags common;
  std::string run;
};

// 1 and 2 are those of errors.
int ExitCodeOf(Verdict verdict) {
  switch (verdict) {
    case Verdict::kGreen:
      return 0;
    case Verdict::kLookAt:
      return 3;
    case Verdict::kDoNotUse:
      return 4;
  }
  return 1;
}

int Check(const CheckFlags& flags) {
  const RunCheck check = CheckRun(flags.run);
  if (!flags.common.quiet) {
    std::printf("%s\n", Describe(check).c_str());
    for (const CheckReason& reason : check.reasons) {
      std::printf("%s: %s: %s\n", Name(reason.verdict), reason.frames.c_str(), reason.text.c_str());
    }
  }
  return ExitCodeOf(check.verdict);
}

}  // namespace

void AddCheckCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<CheckFlags>();
  CLI::App* command = app.add_subcommand(
      "check", "What in a run to trust; exit code 0: green, 3: look at, 4: do not use");
  command->add_option("run", flags->run, "Folder of the run")->required();
  AddCommonFlags(*command, flags->common);
  command->footer("Example: rotslam check runs/kitti00");
  command->callback([flags, &action] { action = [flags] { return Check(*flags); }; });
}

}  // namespace rotslam
