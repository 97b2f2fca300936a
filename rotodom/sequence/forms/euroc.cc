#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/sequence_form.h"
#include "rotodom/sequence/times.h"

namespace rotslam::forms {
namespace {

namespace fs = std::filesystem;

Layout ListEuroc(const fs::path& camera_folder) {
  Layout layout;
  layout.times_source = "data.csv";
  layout.folder = camera_folder / "data";
  const fs::path list = camera_folder / "data.csv";
  for (const TextLine& line : ReadLines(list)) {
    const std::size_t comma = line.text.find(',');
    const auto nanoseconds = ParseInteger(Trimmed(std::string_view(line.text).substr(0, comma)));
    if (!nanoseconds || comma == std::string::npos) {
      FailAtLine(list, line, "'nanoseconds,file name'");
    }
    const std::string name(Trimmed(std::string_view(line.text).substr(comma + 1)));
    layout.entries.push_back({layout.folder / name, SecondsFromTicks(*nanoseconds, 1'000'000'000)});
  }
  if (layout.entries.empty()) Fail(list, "lists no images");
  const fs::path root = camera_folder.parent_path().parent_path();
  layout.camera = FirstCamera({root / "camera.yaml",
                               camera_folder.parent_path() / "camera.yaml",
                               camera_folder / "camera.yaml",
                               camera_folder / "sensor.yaml"});
  // A data set's ground truth is of its cam0.
  if (camera_folder.filename() == "cam0") layout.ground_truth_file = FindGroundTruth(root);
  return layout;
}

// The folder of the camera's images and list: the path itself, or cam0 below it.
std::optional<fs::path> EurocCamera(const fs::path& path) {
  for (const fs::path& folder : {path / "mav0" / "cam0", path / "cam0", path}) {
    if (IsFile(folder / "data.csv")) return folder;
  }
  return std::nullopt;
}

}  // namespace

SequenceForm SequenceFormEuroc() {
  SequenceForm form;
  form.name = "EuRoC ASL";
  form.description = "`mav0/cam0/data.csv` below the path, or the path is `mav0` or a camera of it";
  form.recognises = [](const fs::path& path) {
    return EurocCamera(path).has_value() || IsFolder(path / "mav0");
  };
  form.list = [](const fs::path& path, const SequenceOptions&) {
    const std::optional<fs::path> camera_folder = EurocCamera(path);
    if (!camera_folder) Fail(path / "mav0" / "cam0" / "data.csv", "is missing");
    return ListEuroc(*camera_folder);
  };
  return form;
}

}  // namespace rotslam::forms
