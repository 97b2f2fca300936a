#include "apps/cli/input/pipeline.h"

#include <stdexcept>

#include "apps/cli/input/config.h"
#include "rotodom/types/options.h"

namespace rotslam {

std::optional<std::string> ReadoutOptions::Problem() const {
  if (max_frames < 0) return OutOfRange("max_frames", max_frames, "zero or more");
  return std::nullopt;
}

std::optional<std::string> PipelineOptions::Problem() const {
  if (auto problem = ProblemIn("sequence", sequence)) return problem;
  if (auto problem = ProblemIn("rotodom", rotodom)) return problem;
  if (auto problem = ProblemIn("readout", readout)) return problem;
  if (auto problem = ProblemIn("loop", loop)) return problem;
  if (auto problem = ProblemIn("pure_rotation_segments", pure_rotation_segments)) return problem;
  if (auto problem = ProblemIn("keyframes", keyframes)) return problem;
  if (auto problem = ProblemIn("krot", krot)) return problem;
  if (auto problem = ProblemIn("ba", ba)) return problem;
  if (auto problem = ProblemIn("completion", completion)) return problem;
  if (auto problem = ProblemIn("relocalisation", relocalisation)) return problem;
  if (auto problem = ProblemIn("resection", resection)) return problem;
  if (!(cloud_min_angle_deg >= 0.0)) {
    return OutOfRange("cloud_min_angle_deg", cloud_min_angle_deg, "zero or more");
  }
  if (auto problem = ProblemIn("cloud_outliers", cloud_outliers)) return problem;
  return std::nullopt;
}

void KrotFlags::Override(KrotOptions& options) const {
  if (!start.empty()) options.start = start;
  if (!no_certificate) return;
  options.use_bracket = false;
  if (options.start != "bisection") return;
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

PipelineOptions ReadPipelineOptions(const CommonFlags& common, const InputFlags& input) {
  PipelineOptions options;
  if (!common.config.empty()) LoadOptionsYaml(common.config, options);
  input.Override(options.sequence);
  input.Override(options.loop);
  options.krot.seed = common.seed;
  return options;
}

}  // namespace rotslam
