#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/image_times.h"
#include "rotodom/sequence/sequence_form.h"

namespace rotslam::forms {
namespace {

namespace fs = std::filesystem;

// `image_left` of the first edition, `image_lcam_front` of the second: poses are in
// `pose_left.txt` and so on.
std::string PoseName(const fs::path& image_folder) {
  return "pose_" + image_folder.filename().string().substr(std::string("image_").size()) + ".txt";
}

std::optional<fs::path> TartanAirImages(const fs::path& path) {
  const auto fits = [](const fs::path& folder) {
    return folder.filename().string().starts_with("image_") && IsFolder(folder) &&
           IsFile(folder.parent_path() / PoseName(folder));
  };
  for (const char* name : {"image_left", "image_right", "image_lcam_front", "image_rcam_front"}) {
    if (fits(path / name)) return path / name;
  }
  return fits(path) ? std::optional(path) : std::nullopt;
}

Camera TartanAirCamera(bool is_second_edition) {
  Camera camera;
  camera.width = 640;
  camera.height = is_second_edition ? 640 : 480;
  camera.fx = camera.fy = 320.0;
  camera.cx = 320.0;
  camera.cy = is_second_edition ? 320.0 : 240.0;
  return camera;
}

Layout ListTartanAir(const fs::path& image_folder, const SequenceOptions& options) {
  const fs::path root = image_folder.parent_path();
  Layout layout;
  layout.folder = image_folder;
  AddImages(ImagesIn(image_folder), {image_folder, root}, options, layout);
  layout.camera = FindCamera({image_folder, root}, layout.notes);
  if (!layout.camera) {
    const bool is_second_edition =
        image_folder.filename().string().find("cam_") != std::string::npos;
    layout.own_camera = TartanAirCamera(is_second_edition);
    layout.notes.push_back("the camera is that of TartanAir: " + Describe(*layout.own_camera));
  }
  layout.ground_truth_file = root / PoseName(image_folder);
  return layout;
}

}  // namespace

SequenceForm SequenceFormTartanAir() {
  SequenceForm form;
  form.name = "TartanAir";
  form.description =
      "`image_left/` and `pose_left.txt`, or `image_lcam_front/` and `pose_lcam_front.txt`";
  form.recognises = [](const fs::path& path) { return TartanAirImages(path).has_value(); };
  form.list = [](const fs::path& path, const SequenceOptions& options) {
    return ListTartanAir(TartanAirImages(path).value_or(path), options);
  };
  return form;
}

}  // namespace rotslam::forms
