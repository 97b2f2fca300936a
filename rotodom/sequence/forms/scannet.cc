#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/image_times.h"
#include "rotodom/sequence/sequence_form.h"
#include "rotodom/types/text_file.h"

namespace rotslam::forms {
namespace {

namespace fs = std::filesystem;

// The path is the folder of the scene, or its `color`.
fs::path ScannetRoot(const fs::path& path) {
  return path.filename() == "color" ? path.parent_path() : path;
}

// A matrix of 4 x 4, or of 3 x 3 or 3 x 4, whose upper left is K.
Camera ReadIntrinsicMatrix(const fs::path& file) {
  const std::vector<TextRow> rows = ReadTextRows(file);
  if (rows.size() < 3) Fail(file, "holds " + std::to_string(rows.size()) + " rows, expected 4 x 4");
  Camera camera;
  camera.fx = NumberAt(file, rows[0], 0);
  camera.cx = NumberAt(file, rows[0], 2);
  camera.fy = NumberAt(file, rows[1], 1);
  camera.cy = NumberAt(file, rows[1], 2);
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 3; ++c) {
      const bool is_known = r < 2 && (c == 2 || c == r);
      if (!is_known && NumberAt(file, rows[r], c) != (r == c ? 1.0 : 0.0)) {
        throw std::runtime_error(AtLine(file,
                                        rows[r].line,
                                        "found " + rows[r].words[c] +
                                            ", expected fx 0 cx, 0 fy cy, "
                                            "0 0 1: a camera without skew"));
      }
    }
  }
  if (const auto problem = camera.Problem()) Fail(file, *problem);
  return camera;
}

Layout ListScannet(const fs::path& path, const SequenceOptions& options) {
  const fs::path root = ScannetRoot(path);
  Layout layout;
  layout.folder = root / "color";
  AddImages(ImagesIn(layout.folder), {root}, options, layout);
  layout.camera = FindCamera({root}, layout.notes);
  const fs::path intrinsic = root / "intrinsic" / "intrinsic_color.txt";
  if (!layout.camera && IsFile(intrinsic)) {
    layout.own_camera = ReadIntrinsicMatrix(intrinsic);
    layout.notes.push_back("the camera is that of " + intrinsic.string());
  }
  layout.ground_truth_file = FindGroundTruth(root);
  if (!layout.ground_truth_file && IsFolder(root / "pose")) {
    layout.ground_truth_file = root / "pose";
  }
  return layout;
}

}  // namespace

SequenceForm SequenceFormScannet() {
  SequenceForm form;
  form.name = "ScanNet";
  form.description = "`color/0.jpg` and so on, with `pose/` or `intrinsic/` beside `color/`";
  form.recognises = [](const fs::path& path) {
    const fs::path root = ScannetRoot(path);
    return IsFolder(root / "color") && (IsFolder(root / "pose") || IsFolder(root / "intrinsic"));
  };
  form.list = ListScannet;
  return form;
}

}  // namespace rotslam::forms
