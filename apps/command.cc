#include "apps/command.h"

#include <algorithm>
#include <thread>

namespace rotslam {

int CommonFlags::NumThreads() const {
  return threads > 0 ? threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

void AddCommonFlags(CLI::App& command, CommonFlags& flags) {
  command
      .add_option("--threads",
                  flags.threads,
                  "Threads; 0 takes all cores. The output does not depend on it")
      ->check(CLI::NonNegativeNumber);
  command.add_option("--seed", flags.seed, "Seed of every random choice");
  command.add_option("--config", flags.config, "YAML file that overrides option defaults");
  command.add_flag("--quiet", flags.quiet, "Print errors only");
  command.add_flag("--verbose", flags.verbose, "Print details");
}

}  // namespace rotslam
