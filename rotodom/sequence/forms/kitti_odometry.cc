#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/sequence_form.h"
#include "rotodom/sequence/times.h"

namespace rotslam::forms {
namespace {

namespace fs = std::filesystem;

Layout ListKitti(const fs::path& image_folder) {
  const fs::path root = image_folder.parent_path();
  Layout layout;
  layout.times_source = "times.txt";
  layout.folder = image_folder;
  const fs::path list = root / "times.txt";
  if (!IsFile(list)) {
    Fail(list, "is missing; give " + image_folder.string() + " to take the images without it");
  }
  const std::vector<TextLine> lines = ReadLines(list);
  for (const TextLine& line : lines) {
    if (line.text.find_first_of(" \t") != std::string::npos) FailAtLine(list, line, "seconds");
  }
  const std::vector<double> times_s = TimesOf(list, lines, "seconds");
  const std::vector<fs::path> files = ImagesIn(image_folder);
  if (files.empty()) Fail(image_folder, "holds no images");
  for (std::size_t k = 0; k < files.size(); ++k) {
    // The name is the number of the line, so a part of the images may be given with all the times.
    const std::string stem = files[k].stem().string();
    const auto number = AllDigits(stem) ? ParseInteger(stem) : std::nullopt;
    const auto row = number ? static_cast<std::size_t>(*number) : k;
    if (row >= times_s.size()) {
      Fail(list, "has " + std::to_string(times_s.size()) + " times, none for " + files[k].string());
    }
    layout.entries.push_back({files[k], times_s[row]});
  }
  layout.camera = FirstCamera({root / "camera.yaml", root / "calib.txt"});
  const fs::path poses = (root.filename().string() + ".txt");
  layout.ground_truth_file = FindGroundTruth(root);
  if (!layout.ground_truth_file) {
    layout.ground_truth_file = FirstFile({root.parent_path().parent_path() / "poses" / poses});
  }
  return layout;
}

fs::path KittiImages(const fs::path& path) {
  for (const char* name : {"image_0", "image_2"}) {
    if (IsFolder(path / name)) return path / name;
  }
  return path;
}

}  // namespace

SequenceForm SequenceFormKittiOdometry() {
  SequenceForm form;
  form.name = "KITTI odometry";
  form.description =
      "`image_0/` (else `image_2/`) and `times.txt`; or the path is an `image_*` of it";
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
