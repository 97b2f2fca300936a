#include <algorithm>

#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/image_times.h"
#include "rotodom/sequence/sequence_form.h"

namespace rotslam::forms {
namespace {

namespace fs = std::filesystem;

// The first of the four cameras that is there; the path itself where none is.
fs::path KittiImages(const fs::path& path) {
  for (const char* name : {"image_0", "image_2", "image_1", "image_3"}) {
    if (IsFolder(path / name)) return path / name;
  }
  return path;
}

// "P2" for `image_2`, where `calib.txt` has a row of that name.
std::string ProjectionOf(const fs::path& image_folder, const fs::path& calibration) {
  const std::string folder = image_folder.filename().string();
  const std::string name = "P" + folder.substr(std::min(folder.size(), folder.find('_') + 1));
  const std::vector<TextLine> lines = ReadLines(calibration);
  const bool is_there = std::any_of(lines.begin(), lines.end(), [&](const TextLine& line) {
    return line.text.starts_with(name + ":") || line.text.starts_with(name + " ");
  });
  return is_there ? name : std::string();
}

Layout ListKitti(const fs::path& image_folder) {
  const fs::path root = image_folder.parent_path();
  Layout layout;
  layout.folder = image_folder;
  const fs::path list = root / "times.txt";
  if (!IsFile(list)) {
    Fail(list, "is missing; give " + image_folder.string() + " to take the images without it");
  }
  AddNumberedImages(ImagesIn(image_folder), list, layout);
  layout.camera = FirstCamera({root / "camera.yaml"});
  if (!layout.camera && IsFile(root / "calib.txt")) {
    layout.camera = {root / "calib.txt", ProjectionOf(image_folder, root / "calib.txt")};
  }
  layout.ground_truth_file = FindGroundTruth(root);
  if (!layout.ground_truth_file) {
    const std::string poses = root.filename().string() + ".txt";
    layout.ground_truth_file = FirstFile({root.parent_path().parent_path() / "poses" / poses});
  }
  return layout;
}

}  // namespace

SequenceForm SequenceFormKittiOdometry() {
  SequenceForm form;
  form.name = "KITTI odometry";
  form.description =
      "`image_0/` (else `image_2/`) and `times.txt`; or the folder is an `image_*` beside "
      "`times.txt`";
  form.recognises = [](const fs::path& path) {
    return KittiImages(path) != path || (path.filename().string().starts_with("image_") &&
                                         IsFile(path.parent_path() / "times.txt"));
  };
  form.list = [](const fs::path& path, const SequenceOptions&) {
    return ListKitti(KittiImages(path));
  };
  return form;
}

}  // namespace rotslam::forms
