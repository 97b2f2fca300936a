#include "apps/cli/terminal/common_flags.h"

#include <algorithm>
#include <thread>

namespace rotslam {

int CommonFlags::NumThreads() const {
  return threads > 0 ? threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

namespace {

// CLI11's own check for this names the largest double as the upper limit.
CLI::Validator NumberCheck(const char* what, bool (*allowed)(double)) {
  const auto check = [what, allowed](const std::string& text) {
    double value = 0.0;
    if (CLI::detail::lexical_cast(text, value) && allowed(value)) return std::string();
    return "must be " + std::string(what) + ", not " + text;
  };
  return CLI::Validator(check, "");
}

}  // namespace

CLI::Validator AtLeastZero() {
  return NumberCheck("a number, zero or more", [](double value) { return value >= 0.0; });
}

CLI::Validator AboveZero() {
  return NumberCheck("a number above zero", [](double value) { return value > 0.0; });
}

void AddCommonFlags(CLI::App& command, CommonFlags& flags) {
  command
      .add_option("--threads",
                  flags.threads,
                  "Threads; 0 takes all cores. The output does not depend on it")
      ->check(AtLeastZero());
  command.add_option("--seed", flags.seed, "Seed of every random choice");
  command.add_option("--config", flags.config, "YAML file that overrides option defaults");
  command.add_flag("--quiet", flags.quiet, "Print errors only");
  command.add_flag("--verbose", flags.verbose, "Print details");
  command.add_option("--log", flags.log, "File for all that --verbose says, with times");
}

}  // namespace rotslam
