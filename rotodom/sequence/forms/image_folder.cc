#include <algorithm>
#include <utility>

#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/sequence_form.h"
#include "rotodom/sequence/times.h"

namespace rotslam::forms {
namespace {

namespace fs = std::filesystem;

Layout ListImageFolder(const fs::path& path, double fps) {
  Layout layout;
  layout.folder = path;
  std::vector<fs::path> files = ImagesIn(path);
  if (files.empty() && IsFolder(path / "images")) {
    layout.folder = path / "images";
    files = ImagesIn(layout.folder);
  }
  // 7-Scenes keeps the depth maps beside the pictures, told apart by `.color.` in the name.
  const auto is_colour = [](const fs::path& file) { return file.stem().extension() == ".color"; };
  if (std::any_of(files.begin(), files.end(), is_colour)) {
    std::erase_if(files, [&](const fs::path& file) { return !is_colour(file); });
  }
  if (files.empty()) {
    Fail(layout.folder, "holds no images, and nothing that names a known data set layout");
  }
  std::vector<std::string> stems;
  stems.reserve(files.size());
  for (const fs::path& file : files) stems.push_back(file.stem().string());
  const auto times_s = TimestampsFromNames(stems);
  layout.times_are_made_up = !times_s;
  layout.times_source = times_s ? "file names" : MadeUpTimes(fps);
  for (std::size_t k = 0; k < files.size(); ++k) {
    const double time_s = times_s ? (*times_s)[k] : static_cast<double>(k) / fps;
    layout.entries.push_back({std::move(files[k]), time_s});
  }
  std::stable_sort(
      layout.entries.begin(), layout.entries.end(), [](const ImageEntry& a, const ImageEntry& b) {
        return a.timestamp_s < b.timestamp_s;
      });
  const fs::path root =
      layout.folder.filename() == "images" ? layout.folder.parent_path() : layout.folder;
  layout.camera = FirstCamera({layout.folder / "camera.yaml", root / "camera.yaml"});
  layout.ground_truth_file = FindGroundTruth(root);
  return layout;
}

}  // namespace

SequenceForm SequenceFormImageFolder() {
  SequenceForm form;
  form.name = "image folder";
  form.description = "images in the folder itself, else in its `images/`";
  form.rank = 100;
  form.recognises = IsFolder;
  form.list = [](const fs::path& path, const SequenceOptions& options) {
    return ListImageFolder(path, options.fps);
  };
  return form;
}

}  // namespace rotslam::forms
