#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/image_times.h"
#include "rotodom/sequence/sequence_form.h"

namespace rotslam::forms {
namespace {

namespace fs = std::filesystem;

// The folder of a camera, that is of its `timestamps.txt` and its `data`: the path itself, the
// folder above it, or the first of the four cameras below it.
std::optional<fs::path> KittiRawCamera(const fs::path& path) {
  const auto is_camera = [](const fs::path& folder) {
    return folder.filename().string().starts_with("image_0") && IsFolder(folder / "data");
  };
  for (const char* name : {"image_00", "image_02", "image_01", "image_03"}) {
    if (is_camera(path / name)) return path / name;
  }
  if (is_camera(path)) return path;
  if (path.filename() == "data" && is_camera(path.parent_path())) return path.parent_path();
  return std::nullopt;
}

Layout ListKittiRaw(const fs::path& camera_folder, const SequenceOptions& options) {
  Layout layout;
  layout.folder = camera_folder / "data";
  const fs::path list = camera_folder / "timestamps.txt";
  if (IsFile(list)) {
    AddNumberedImages(ImagesIn(layout.folder), list, layout);
  } else {
    layout.notes.push_back(list.string() + " is missing");
    AddImages(ImagesIn(layout.folder), {camera_folder}, options, layout);
  }
  const fs::path drive = camera_folder.parent_path();
  layout.camera = FirstCamera({drive / "camera.yaml",
                               camera_folder / "camera.yaml",
                               drive / "calib_cam_to_cam.txt",
                               drive.parent_path() / "calib_cam_to_cam.txt"});
  layout.ground_truth_file = FindGroundTruth(drive);
  if (!layout.ground_truth_file && IsFolder(drive / "oxts")) {
    layout.notes.push_back("oxts/ (GPS and IMU) is not read as ground truth");
  }
  return layout;
}

}  // namespace

SequenceForm SequenceFormKittiRaw() {
  SequenceForm form;
  form.name = "KITTI raw";
  form.description =
      "a drive: `image_00/data/` and `image_00/timestamps.txt`; or the folder is an `image_0*` of "
      "it";
  form.recognises = [](const fs::path& path) { return KittiRawCamera(path).has_value(); };
  form.list = [](const fs::path& path, const SequenceOptions& options) {
    return ListKittiRaw(KittiRawCamera(path).value_or(path), options);
  };
  return form;
}

}  // namespace rotslam::forms
