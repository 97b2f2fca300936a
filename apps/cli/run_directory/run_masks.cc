#include "apps/cli/run_directory/run_masks.h"

#include <fstream>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "output/files/atomic_file.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

nlohmann::ordered_json ReadJson(const fs::path& file) {
  std::ifstream stream(file);
  try {
    return nlohmann::ordered_json::parse(stream);
  } catch (const nlohmann::json::exception&) {
    throw std::runtime_error(file.string() + ": cannot be read");
  }
}

}  // namespace

FrameMasks ReadRunMasks(const fs::path& run) {
  FrameMasks masks;
  if (!fs::exists(run / "summary.json")) return masks;
  const nlohmann::ordered_json summary = ReadJson(run / "summary.json");
  if (!summary.contains("masks")) return masks;
  const nlohmann::ordered_json& table = summary.at("masks");
  if (table.contains("file")) {
    masks.AddToAll(ReadMask(run / table.at("file").get<std::string>(), {}));
  }
  if (table.contains("folder")) {
    const nlohmann::ordered_json& camera = summary.at("camera");
    const cv::Size size(camera.at("width").get<int>(), camera.at("height").get<int>());
    masks.AddFolder(table.at("folder").get<std::string>(), {}, size);
  }
  return masks;
}

int ExportMasks(const fs::path& run,
                const std::vector<std::string>& images,
                const fs::path& folder,
                const std::function<cv::Mat(const cv::Mat&)>& change) {
  return static_cast<int>(WriteMasks(ReadRunMasks(run), images, folder, change).size());
}

void AddMaskPaths(const fs::path& transforms) {
  nlohmann::ordered_json json = ReadJson(transforms);
  if (!json.contains("frames")) {
    throw std::runtime_error(transforms.string() + ": has no frames");
  }
  for (nlohmann::ordered_json& frame : json.at("frames")) {
    const fs::path image = frame.at("file_path").get<std::string>();
    frame["mask_path"] = "masks/" + image.filename().string() + ".png";
  }
  constexpr int kIndent = 2;
  ReplaceFile(transforms, json.dump(kIndent) + "\n");
}

}  // namespace rotslam
