#include "apps/run_summary.h"

#include <fstream>
#include <stdexcept>

namespace rotslam {

nlohmann::ordered_json ReadSummaryOf(const std::filesystem::path& run) {
  const std::filesystem::path path = run / "summary.json";
  std::ifstream file(path);
  if (!file) {
    throw std::runtime_error(path.string() +
                             ": cannot be read; give the folder that `rotslam run` or `rotslam "
                             "rotations` has written to");
  }
  nlohmann::ordered_json summary = nlohmann::ordered_json::parse(file, nullptr, false);
  if (summary.is_discarded() || !summary.contains("sequence") || !summary.contains("camera")) {
    throw std::runtime_error(path.string() + ": is no summary of a run; run the sequence again");
  }
  return summary;
}

SequenceOptions SequenceOptionsOf(const nlohmann::ordered_json& summary) {
  SequenceOptions options;
  const nlohmann::ordered_json& json = summary.at("options").at("sequence");
  options.first = json.at("first");
  options.last = json.at("last");
  options.stride = json.at("stride");
  options.fps = json.at("fps");
  return options;
}

}  // namespace rotslam
