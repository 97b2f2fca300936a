#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/distortion.h"

namespace rotslam {
namespace {

// A key as programs spell it ("Camera_Matrix", "cameraMatrix1", "LEFT.K"): letters in lower case
// without signs, and the side or number of the camera apart.
struct OpenCvKey {
  std::string base;
  std::string side;
};

OpenCvKey ParseOpenCvKey(const std::string& key) {
  OpenCvKey parsed;
  for (const char c : Lower(key)) {
    if (c != '_' && c != '-' && c != '.' && c != ' ') parsed.base += c;
  }
  for (const std::string side : {"left", "right", "1", "2"}) {
    if (parsed.base.starts_with(side)) {
      parsed.side = side;
      parsed.base.erase(0, side.size());
      break;
    }
    if (parsed.base.ends_with(side)) {
      parsed.side = side;
      parsed.base.erase(parsed.base.size() - side.size());
      break;
    }
  }
  return parsed;
}

template <class Names>
bool IsOneOf(const std::string& name, const Names& names) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

bool IsMatrixName(const std::string& base) {
  static const std::array<std::string, 9> kNames = {"cameramatrix",
                                                    "cammatrix",
                                                    "cameramat",
                                                    "intrinsicmatrix",
                                                    "intrinsics",
                                                    "intrinsic",
                                                    "k",
                                                    "m",
                                                    "mtx"};
  return IsOneOf(base, kNames);
}

bool IsDistortionName(const std::string& base) {
  static const std::array<std::string, 12> kNames = {"distcoeffs",
                                                     "distcoeff",
                                                     "distcoefs",
                                                     "distortioncoefficients",
                                                     "distortioncoefficient",
                                                     "distortioncoeffs",
                                                     "distortionparameters",
                                                     "distortionvector",
                                                     "distcoefficients",
                                                     "distortion",
                                                     "dist",
                                                     "d"};
  return IsOneOf(base, kNames);
}

// The numbers under a node, without looking at them.
std::size_t CountNumbers(const TreeNode& node) {
  if (node.kind == TreeNode::Kind::kMap) {
    for (const TreeNode& child : node.children) {
      if (child.key == "data") return CountNumbers(child);
    }
    return 0;
  }
  if (node.kind == TreeNode::Kind::kList) {
    std::size_t count = 0;
    for (const TreeNode& child : node.children) count += CountNumbers(child);
    return count;
  }
  if (node.kind == TreeNode::Kind::kNothing) return 0;
  std::size_t words = 0;
  bool in_word = false;
  for (const char c : node.text) {
    const bool blank = c == ' ' || c == '\n' || c == '\t';
    if (!blank && !in_word) ++words;
    in_word = !blank;
  }
  return words;
}

// Keys of a section that have a camera matrix.
std::vector<std::string> MatrixKeys(const Section& section) {
  std::vector<std::string> keys;
  for (const TreeNode& child : section.node().children) {
    const bool is_matrix =
        IsMatrixName(ParseOpenCvKey(child.key).base) &&
        (child.kind == TreeNode::Kind::kMap ? CountNumbers(child) > 0 : CountNumbers(child) >= 6);
    if (is_matrix) keys.push_back(child.key);
  }
  return keys;
}

// The key of the coefficients that belong to a matrix; empty where there are none.
std::string DistortionKey(const Section& section, const std::string& matrix_key) {
  const std::string side = ParseOpenCvKey(matrix_key).side;
  for (const TreeNode& child : section.node().children) {
    const OpenCvKey key = ParseOpenCvKey(child.key);
    if (IsDistortionName(key.base) && key.side == side && child.kind != TreeNode::Kind::kNothing) {
      return child.key;
    }
  }
  return "";
}

void ReadOpenCvSize(const Section& section, Camera& camera) {
  std::optional<std::string> width;
  std::optional<std::string> height;
  for (const TreeNode& child : section.node().children) {
    const std::string base = ParseOpenCvKey(child.key).base;
    if (child.kind == TreeNode::Kind::kList &&
        (base == "imagesize" || base == "size" || base == "resolution")) {
      ReadSizeList(section, child.key, camera.width, camera.height);
      return;
    }
    if (child.kind != TreeNode::Kind::kValue) continue;
    if (base == "imagesize" && CountNumbers(child) == 2) {
      ReadSizeList(section, child.key, camera.width, camera.height);
      return;
    }
    if (base == "imagewidth" || base == "width" || base == "cols") width = child.key;
    if (base == "imageheight" || base == "height" || base == "rows") height = child.key;
  }
  ReadSize(section,
           width.value_or("image_width"),
           height.value_or("image_height"),
           camera.width,
           camera.height);
}

// True where the file itself says that its lenses are fisheyes.
bool SaysFisheye(const Section& section) {
  for (const TreeNode& child : section.node().children) {
    const std::string base = ParseOpenCvKey(child.key).base;
    if (child.kind != TreeNode::Kind::kValue) continue;
    if (base == "fisheye" || base == "fisheyemodel" || base == "isfisheye" ||
        base == "usefisheye") {
      return section.Flag(child.key);
    }
    if (base != "model" && base != "cameramodel" && base != "distortionmodel" &&
        base != "modeltype") {
      continue;
    }
    const std::string model = Lower(child.text);
    if (model == "fisheye" || model == "equidistant" || model == "kannala_brandt") return true;
    if (model == "pinhole" || model == "perspective" || model == "plumb_bob" || model == "radtan" ||
        model == "standard" || model == "opencv" || model == "brown" ||
        model == "rational_polynomial" || model == "rational") {
      continue;
    }
    section.FailValue(child.key, "which is not supported; must be pinhole or fisheye");
  }
  return false;
}

Camera ReadOpenCvCamera(const Section& section, const std::string& matrix_key) {
  if (section.Has("xi") && section.Numbers("xi") != std::vector<double>{0.0}) {
    section.Fail("xi",
                 "belongs to the omnidirectional model, which is not supported; calibrate as "
                 "fisheye");
  }
  Camera camera;
  ReadMatrixAndDistortion(
      section, matrix_key, DistortionKey(section, matrix_key), SaysFisheye(section), camera);
  ReadOpenCvSize(section, camera);
  return camera;
}

// The camera's name in a file of several: its matrix's key, without what every one has.
std::string OpenCvName(const std::string& matrix_key) {
  const std::size_t point = matrix_key.find('.');
  return point == std::string::npos ? matrix_key : matrix_key.substr(0, point);
}

void NoteDistortion(const Section& section, const std::string& matrix_key, CameraFile& file) {
  const std::string key = DistortionKey(section, matrix_key);
  if (key.empty()) {
    file.notes.push_back(matrix_key +
                         " has no distortion coefficients beside it: taken as a "
                         "camera without distortion");
  } else if (section.Numbers(key).size() == 4 && !SaysFisheye(section)) {
    file.notes.push_back("the 4 values of " + key +
                         " are taken as k1 k2 p1 p2; for a lens that "
                         "was calibrated with cv::fisheye add the line `fisheye: 1`");
  }
}

CameraFile ReadOpenCv(const CameraDocument& document) {
  const Section section = document.root();
  CameraFile file;
  const std::vector<std::string> keys = MatrixKeys(section);
  for (const std::string& key : keys) {
    file.Add(keys.size() == 1 ? "" : OpenCvName(key),
             [&] { return ReadOpenCvCamera(section, key); });
    if (file.cameras.back().problem.empty()) NoteDistortion(section, key, file);
  }
  return file;
}

}  // namespace

namespace forms {

CameraForm CameraFormOpencv() {
  CameraForm form;
  form.name = "OpenCV storage";
  form.description =
      "YAML, XML or JSON with `camera_matrix` (or K, M1, ...) of 9 values and `dist_coeffs` (or D, "
      "D1, ...) of 4, 5 or 8; with `fisheye: 1` k1 k2 k3 k4";
  form.recognises = [](const CameraDocument& document) {
    const Section root = document.root();
    const bool is_ros = root.HasAny({"distortion_model", "projection_matrix"});
    const bool is_other = root.HasAny({"model_type", "fl_x", "frames", "sfm_data_version"});
    const bool is_flat = root.HasAny({"Camera.fx", "Camera1.fx", "Camera.type", "Camera.model"});
    return !is_ros && !is_other && !is_flat && !MatrixKeys(root).empty() &&
           !(root.HasAny({"camera_model"}) && root.HasAny({"intrinsics"}));
  };
  form.read = ReadOpenCv;
  return form;
}

}  // namespace forms
}  // namespace rotslam
