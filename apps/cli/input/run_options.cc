#include "apps/cli/input/run_options.h"

#include <stdexcept>

#include "apps/cli/input/config.h"
#include "output/files/option_list.h"
#include "rotodom/types/options.h"

namespace rotslam {

std::optional<std::string> RunOptions::Problem() const {
  if (auto problem = ProblemIn("sequence", sequence)) return problem;
  return SlamOptions::Problem();
}

void KrotFlags::Override(KrotOptions& options) const {
  if (!start.empty()) ChoiceField(options.start).Assign(start);
  if (!no_certificate) return;
  options.use_bracket = false;
  if (options.start != KrotStart::kBisection) return;
  throw std::runtime_error(
      "--no-certificate leaves out the bisection that --krot bisection asks for");
}

void AddKrotFlags(CLI::App& command, KrotFlags& flags) {
  command
      .add_option(
          "--krot",
          flags.start,
          "Which answer bundle adjustment starts from: l1 (least sum of misses; default), "
          "bisection (least largest residual) or positioning (rays nearest to what was seen)")
      ->check(CLI::IsMember({"l1", "bisection", "positioning"}));
  command.add_flag("--no-certificate",
                   flags.no_certificate,
                   "Do not bound how far the largest residual is from the least possible");
}

RunOptions ReadRunOptions(const CommonFlags& common) {
  RunOptions options;
  if (!common.config.empty()) LoadOptionsYaml(common.config, options);
  options.seed = options.krot.seed = common.seed;
  options.num_threads = common.NumThreads();
  return options;
}

RunOptions ReadRunOptions(const CommonFlags& common, const InputFlags& input) {
  RunOptions options = ReadRunOptions(common);
  input.Override(options.sequence);
  input.Override(options.loop);
  return options;
}

}  // namespace rotslam
