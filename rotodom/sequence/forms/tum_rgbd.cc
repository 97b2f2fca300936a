#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/image_times.h"
#include "rotodom/sequence/sequence_form.h"

namespace rotslam::forms {
namespace {

namespace fs = std::filesystem;

std::optional<fs::path> TumList(const fs::path& root) {
  return FirstFile({root / "rgb.txt",
                    root / "associations.txt",
                    root / "associated.txt",
                    root / "association.txt",
                    root / "associate.txt"});
}

// Trajectories of ICL-NUIM: `livingRoom2.gt.freiburg`, `traj2n.gt.freiburg`.
std::optional<fs::path> IclNuimTruth(const fs::path& root) {
  std::error_code error;
  for (fs::directory_iterator entries(root, error), end; !error && entries != end;
       entries.increment(error)) {
    if (entries->path().filename().string().ends_with(".gt.freiburg")) return entries->path();
  }
  return std::nullopt;
}

// As its authors give it; they render y upwards, which the images do not show.
Camera IclNuimCamera() {
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = 481.2;
  camera.fy = 480.0;
  camera.cx = 319.5;
  camera.cy = 239.5;
  return camera;
}

Layout ListTumRgbd(const fs::path& root, const SequenceOptions& options) {
  Layout layout;
  layout.folder = root;
  const std::optional<fs::path> list = TumList(root);
  if (!list) Fail(root / "rgb.txt", "is missing");
  AddListedImages(*list, {root, root / "rgb"}, options, layout);
  layout.camera = FindCamera({root}, layout.notes);
  layout.ground_truth_file = FindGroundTruth(root);
  if (const auto truth = IclNuimTruth(root)) {
    layout.own_camera = IclNuimCamera();
    if (!layout.ground_truth_file) layout.ground_truth_file = truth;
    if (!layout.camera) layout.notes.push_back("the camera is that of ICL-NUIM, f = (481.2, 480)");
  }
  return layout;
}

}  // namespace

SequenceForm SequenceFormTumRgbd() {
  SequenceForm form;
  form.name = "TUM RGB-D";
  form.description =
      "also ICL-NUIM and Bonn: `rgb.txt`, `associations.txt` or `associated.txt`, a time and the "
      "name "
      "of an image in each line";
  form.recognises = [](const fs::path& path) { return TumList(path).has_value(); };
  form.list = ListTumRgbd;
  return form;
}

}  // namespace rotslam::forms
