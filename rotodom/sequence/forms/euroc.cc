#include <algorithm>

#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/image_times.h"
#include "rotodom/sequence/sequence_form.h"
#include "rotodom/sequence/times.h"

namespace rotslam::forms {
namespace {

namespace fs = std::filesystem;

bool IsEurocCamera(const fs::path& folder) {
  return IsFile(folder / "data.csv") &&
         (IsFolder(folder / "data") || folder.filename().string().starts_with("cam"));
}

// The folder of a camera, that is of its list and its `data`: the path itself or cam0 below it.
std::optional<fs::path> EurocCamera(const fs::path& path) {
  for (const fs::path& folder : {path / "mav0" / "cam0", path / "cam0", path, path.parent_path()}) {
    if (folder == path.parent_path() && path.filename() != "data") continue;
    if (IsEurocCamera(folder)) return folder;
  }
  return std::nullopt;
}

void AddEurocImages(const fs::path& camera_folder, Layout& layout) {
  const fs::path list = camera_folder / "data.csv";
  ListedFiles files(list, {layout.folder, camera_folder});
  for (const TextLine& line : ReadLines(list)) {
    const std::vector<std::string> cells = CutIntoCells(line.text);
    const auto nanoseconds = cells.empty() ? std::nullopt : ParseInteger(cells[0]);
    if (!nanoseconds && layout.entries.empty() && cells.size() > 1 && !ParseNumber(cells[0])) {
      continue;  // titles of the columns without a '#'
    }
    if (!nanoseconds || cells.size() < 2) FailAtLine(list, line, "'nanoseconds,file name'");
    layout.entries.push_back(
        {files.Find(cells[1]), SecondsFromTicks(*nanoseconds, 1'000'000'000), line.number});
  }
  if (layout.entries.empty()) Fail(list, "lists no images");
  files.AddNotes(layout.notes);
  layout.time_list = list;
  layout.times_source = "data.csv (ns)";
}

Layout ListEuroc(const fs::path& camera_folder, const SequenceOptions& options) {
  Layout layout;
  layout.folder = camera_folder / "data";
  if (IsFile(camera_folder / "data.csv")) {
    AddEurocImages(camera_folder, layout);
  } else {
    layout.notes.push_back((camera_folder / "data.csv").string() + " is missing");
    AddImages(ImagesIn(layout.folder), {camera_folder}, options, layout);
  }
  const fs::path device = camera_folder.parent_path();
  const fs::path root = device.filename() == "mav0" ? device.parent_path() : device;
  layout.camera = FirstCamera({root / "camera.yaml",
                               device / "camera.yaml",
                               camera_folder / "camera.yaml",
                               camera_folder / "sensor.yaml",
                               root / "dso" / "camchain.yaml",  // TUM-VI
                               root / "camchain.yaml"});
  // A TUM file is of the data set's cam0, the data set's own files are of its body.
  if (camera_folder.filename() == "cam0") layout.ground_truth_file = FindGroundTruth(root);
  if (!layout.ground_truth_file) {
    layout.ground_truth_file = FirstFile(
        {device / "state_groundtruth_estimate0" / "data.csv", device / "mocap0" / "data.csv"});
  }
  return layout;
}

}  // namespace

SequenceForm SequenceFormEuroc() {
  SequenceForm form;
  form.name = "EuRoC ASL";
  form.description =
      "also TUM-VI: `mav0/cam0/data.csv` below the folder; or the folder is `mav0`, or a `cam*` of "
      "it";
  form.recognises = [](const fs::path& path) {
    return EurocCamera(path).has_value() || IsFolder(path / "mav0");
  };
  form.list = [](const fs::path& path, const SequenceOptions& options) {
    const fs::path cam0 = path / "mav0" / "cam0";
    const std::optional<fs::path> camera_folder = EurocCamera(path);
    if (!camera_folder && !IsFolder(cam0 / "data")) {
      Fail(cam0 / "data.csv", "is missing; give the folder of the images to take them without it");
    }
    return ListEuroc(camera_folder.value_or(cam0), options);
  };
  return form;
}

}  // namespace rotslam::forms
