#include <algorithm>

#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/image_times.h"
#include "rotodom/sequence/sequence_form.h"

namespace rotslam::forms {
namespace {

namespace fs = std::filesystem;

// `frame-000000.color.png`, beside `frame-000000.depth.png`.
bool IsColourImage(const fs::path& file) {
  return IsImageName(file) && Lower(file.stem().extension().string()) == ".color";
}

std::vector<fs::path> ColourImagesIn(const fs::path& folder) {
  std::vector<fs::path> files = ImagesIn(folder);
  std::erase_if(files, [](const fs::path& file) { return !IsColourImage(file); });
  return files;
}

bool HasColourImages(const fs::path& folder) {
  std::error_code error;
  for (fs::directory_iterator entries(folder, error), end; !error && entries != end;
       entries.increment(error)) {
    if (IsColourImage(entries->path())) return true;
  }
  return false;
}

Layout ListSevenScenes(const fs::path& path, const SequenceOptions& options) {
  Layout layout;
  layout.folder = path;
  AddImages(ColourImagesIn(path), {path, path.parent_path()}, options, layout);
  layout.camera = FindCamera({path}, layout.notes);
  layout.ground_truth_file = FindGroundTruth(path);
  // frame-000000.color.png -> frame-000000.pose.txt
  const fs::path frame = layout.entries.front().file.stem();
  if (!layout.ground_truth_file && IsFile(path / fs::path(frame).replace_extension(".pose.txt"))) {
    layout.ground_truth_file = path;
  }
  return layout;
}

}  // namespace

SequenceForm SequenceFormSevenScenes() {
  SequenceForm form;
  form.name = "7-Scenes";
  form.description = "`frame-000000.color.png` and so on, with poses in `frame-000000.pose.txt`";
  form.recognises = HasColourImages;
  form.list = ListSevenScenes;
  return form;
}

}  // namespace rotslam::forms
