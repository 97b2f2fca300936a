#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/distortion.h"

namespace rotslam {
namespace {

const std::vector<std::string>& OurKeys() {
  static const std::vector<std::string> kKeys = {"model",
                                                 "width",
                                                 "height",
                                                 "fx",
                                                 "fy",
                                                 "cx",
                                                 "cy",
                                                 "distortion",
                                                 "readout_s",
                                                 "readout_from",
                                                 "sigma_focal_px",
                                                 "sigma_cx_px",
                                                 "sigma_cy_px",
                                                 "sigma_distortion",
                                                 "masked_px"};
  return kKeys;
}

void ReadOurDistortion(const Section& section, Camera& camera) {
  const auto names = DistortionNames(camera.model);
  if (!names.empty() && !section.Has("distortion")) {
    section.Fail("distortion", "is missing");
  }
  const std::vector<double> values = section.Numbers("distortion");
  std::string wanted = std::to_string(names.size());
  std::size_t fewest = names.size();
  if (camera.model == CameraModel::kRadtan) wanted = std::to_string(--fewest) + " or " + wanted;
  wanted = names.empty() ? "none" : wanted + ":";
  for (const char* name : names) wanted.append(" ").append(name);
  // Zeros say nothing: pinhole files often carry four of them.
  const bool is_silent =
      names.empty() && values.size() <= camera.distortion.size() &&
      std::all_of(values.begin(), values.end(), [](double v) { return v == 0.0; });
  if (!is_silent && (values.size() < fewest || values.size() > names.size())) {
    section.Fail("distortion",
                 "has " + std::to_string(values.size()) + " values, " + Name(camera.model) +
                     " takes " + wanted);
  }
  std::copy(values.begin(), values.end(), camera.distortion.begin());
  if (camera.model != CameraModel::kFov) return;
  if (const auto problem = SetFovDistortion(values, camera)) section.Fail("distortion", *problem);
}

// All of them or none.
std::optional<LensSigmas> ReadSigmas(const Section& section, const Camera& camera) {
  if (!section.HasAny({"sigma_focal_px", "sigma_cx_px", "sigma_cy_px", "sigma_distortion"})) {
    return std::nullopt;
  }
  LensSigmas sigmas;
  const auto read = [&](const char* key) {
    const double value = section.Number(key);
    if (value < 0.0) section.FailValue(key, "must not be negative");
    return value;
  };
  sigmas.focal_px = read("sigma_focal_px");
  sigmas.cx_px = read("sigma_cx_px");
  sigmas.cy_px = read("sigma_cy_px");
  const auto wanted = static_cast<std::size_t>(NumLensCoefficients(camera.model));
  const std::vector<double> values = section.Numbers("sigma_distortion");
  if (values.size() != wanted) {
    section.Fail("sigma_distortion",
                 "has " + std::to_string(values.size()) + " values, " + Name(camera.model) +
                     " takes " + std::to_string(wanted));
  }
  for (std::size_t k = 0; k < wanted; ++k) {
    if (values[k] < 0.0) section.Fail("sigma_distortion", "must not be negative");
    sigmas.distortion[k] = values[k];
  }
  return sigmas;
}

// `masked_px`: one polygon [[x, y], ...], or a list of polygons.
std::vector<std::vector<Eigen::Vector2d>> ReadMaskedParts(const Section& section) {
  std::vector<std::vector<Eigen::Vector2d>> polygons;
  const TreeNode* masked = nullptr;
  for (const TreeNode& child : section.node().children) {
    if (child.key == "masked_px") masked = &child;
  }
  if (masked == nullptr || masked->kind == TreeNode::Kind::kNothing) return polygons;
  const auto fail = [&](const TreeNode& node) {
    FailAt(section.file(),
           node.line,
           "masked_px must be polygons of at least three points: [[[x, y], [x, y], [x, y]]]");
  };
  const auto is_list = [](const TreeNode& node) { return node.kind == TreeNode::Kind::kList; };
  const auto is_point = [&](const TreeNode& node) {
    return is_list(node) && node.children.size() == 2 && !is_list(node.children.front());
  };
  const auto read = [&](const TreeNode& node) {
    std::vector<Eigen::Vector2d>& polygon = polygons.emplace_back();
    if (!is_list(node) || node.children.size() < 3) fail(node);
    for (const TreeNode& point : node.children) {
      if (!is_point(point)) fail(point);
      const auto number = [&](const TreeNode& value) {
        return FiniteNumber(section.file(), value.line, "masked_px", value.text);
      };
      polygon.emplace_back(number(point.children[0]), number(point.children[1]));
    }
  };
  if (!is_list(*masked) || masked->children.empty()) fail(*masked);
  if (is_point(masked->children.front())) {
    read(*masked);
    return polygons;
  }
  for (const TreeNode& polygon : masked->children) read(polygon);
  return polygons;
}

Camera ReadOurs(const Section& section) {
  std::string known;
  for (const std::string& key : OurKeys()) known += (known.empty() ? "" : ", ") + key;
  for (const TreeNode& child : section.node().children) {
    if (std::find(OurKeys().begin(), OurKeys().end(), child.key) != OurKeys().end()) continue;
    FailAt(section.file(),
           child.line,
           child.key.substr(0, 60) + " is no key of a camera file; known are " + known);
  }
  Camera camera;
  const auto model = FindCameraModel(section.Text("model"));
  if (!model) section.FailValue("model", "must be one of " + CameraModelNames());
  camera.model = *model;
  ReadSize(section, "width", "height", camera.width, camera.height);
  camera.fx = section.Positive("fx");
  camera.fy = section.Positive("fy");
  camera.cx = section.Number("cx");
  camera.cy = section.Number("cy");
  ReadOurDistortion(section, camera);
  camera.readout_s = section.NumberOr("readout_s", 0.0);
  camera.knows_readout = section.Has("readout_s");
  if (!(camera.readout_s >= 0.0 && camera.readout_s < 1.0)) {
    section.FailValue("readout_s", "must be 0 or more and below 1 second");
  }
  if (section.Has("readout_from")) {
    const auto start = FindReadoutStart(section.Text("readout_from"));
    if (!start) section.FailValue("readout_from", "must be top, bottom, left or right");
    camera.readout_from = *start;
  }
  return camera;
}

}  // namespace

namespace forms {

CameraForm CameraFormOurs() {
  CameraForm form;
  form.name = "rotslam YAML";
  form.description =
      "`model: radtan`, `width`, `height`, `fx`, `fy`, `cx`, `cy`, `distortion: [..]`";
  form.file_names = {"camera.yaml"};
  form.recognises = [](const CameraDocument& document) {
    const Section root = document.root();
    return root.HasAny({"model", "fx"}) && !root.HasAny({"camera_matrix",
                                                         "cameraMatrix",
                                                         "K",
                                                         "model_type",
                                                         "camera_model",
                                                         "fl_x",
                                                         "camera_angle_x",
                                                         "frames",
                                                         "sfm_data_version",
                                                         "value0",
                                                         "Camera"});
  };
  form.read = [](const CameraDocument& document) {
    CameraFile file;
    file.cameras.push_back({"", ReadOurs(document.root()), {}, ""});
    file.cameras.back().sigmas = ReadSigmas(document.root(), file.cameras.back().camera);
    file.cameras.back().masked_px = ReadMaskedParts(document.root());
    return file;
  };
  return form;
}

}  // namespace forms
}  // namespace rotslam
