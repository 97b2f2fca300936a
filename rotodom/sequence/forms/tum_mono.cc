#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/image_times.h"
#include "rotodom/sequence/sequence_form.h"

namespace rotslam::forms {
namespace {

namespace fs = std::filesystem;

// The path is the folder of the sequence, or its `images`.
fs::path TumMonoRoot(const fs::path& path) {
  return path.filename() == "images" ? path.parent_path() : path;
}

Layout ListTumMono(const fs::path& path, const SequenceOptions& options) {
  const fs::path root = TumMonoRoot(path);
  Layout layout;
  layout.folder = root / "images";
  if (!IsFolder(layout.folder)) {
    const std::string packed = (root / "images.zip").string();
    Fail(packed, "is packed; unpack it: unzip " + packed + " -d " + layout.folder.string());
  }
  AddImages(ImagesIn(layout.folder), {root}, options, layout);
  layout.camera = FindCamera({root}, layout.notes);
  layout.ground_truth_file = FindGroundTruth(root);
  if (!layout.ground_truth_file) {
    layout.ground_truth_file = FirstFile({root / "groundtruthSync.txt"});
  }
  PhotometricFiles photometric;
  photometric.inverse_response = FirstFile({root / "pcalib.txt"});
  photometric.vignette = FirstFile({root / "vignette.png"});
  if (photometric.vignette) {
    layout.notes.push_back(
        "vignetting is taken out as vignette.png" +
        std::string(photometric.inverse_response ? " and pcalib.txt say" : " says"));
    layout.photometric = photometric;
  } else if (photometric.inverse_response) {
    layout.notes.push_back(
        "pcalib.txt (the camera's response) is not used: no vignette.png is there");
  }
  return layout;
}

}  // namespace

SequenceForm SequenceFormTumMono() {
  SequenceForm form;
  form.name = "DSO / TUM-mono";
  form.description = "`images/`, `times.txt` (id, seconds, exposure) and `camera.txt`";
  form.recognises = [](const fs::path& path) {
    const fs::path root = TumMonoRoot(path);
    return IsFile(root / "times.txt") && IsFile(root / "camera.txt") &&
           (IsFolder(root / "images") || IsFile(root / "images.zip"));
  };
  form.list = ListTumMono;
  return form;
}

}  // namespace rotslam::forms
