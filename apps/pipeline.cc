#include "apps/pipeline.h"

namespace rotslam {
namespace {

template <class Options>
std::optional<std::string> ProblemIn(const char* name, const Options& options) {
  const std::optional<std::string> problem = options.Problem();
  if (!problem) return std::nullopt;
  return std::string(name) + "." + *problem;
}

}  // namespace

std::optional<std::string> PipelineOptions::Problem() const {
  if (auto problem = ProblemIn("sequence", sequence)) return problem;
  if (auto problem = ProblemIn("rotodom", rotodom)) return problem;
  if (auto problem = ProblemIn("held_stretches", held_stretches)) return problem;
  if (auto problem = ProblemIn("keyframes", keyframes)) return problem;
  if (auto problem = ProblemIn("krot", krot)) return problem;
  if (auto problem = ProblemIn("ba", ba)) return problem;
  if (auto problem = ProblemIn("resection", resection)) return problem;
  if (!(cloud_min_angle_deg >= 0.0)) {
    return "cloud_min_angle_deg = " + std::to_string(cloud_min_angle_deg) +
           ": must be zero or more";
  }
  return std::nullopt;
}

}  // namespace rotslam
