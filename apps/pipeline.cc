#include "apps/pipeline.h"

#include "apps/config.h"
#include "rotodom/types/options.h"

namespace rotslam {
std::optional<std::string> PipelineOptions::Problem() const {
  if (auto problem = ProblemIn("sequence", sequence)) return problem;
  if (auto problem = ProblemIn("rotodom", rotodom)) return problem;
  if (auto problem = ProblemIn("loop", loop)) return problem;
  if (auto problem = ProblemIn("held_stretches", held_stretches)) return problem;
  if (auto problem = ProblemIn("keyframes", keyframes)) return problem;
  if (auto problem = ProblemIn("krot", krot)) return problem;
  if (auto problem = ProblemIn("ba", ba)) return problem;
  if (auto problem = ProblemIn("resection", resection)) return problem;
  if (!(cloud_min_angle_deg >= 0.0)) {
    return OutOfRange("cloud_min_angle_deg", cloud_min_angle_deg, "zero or more");
  }
  return std::nullopt;
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
