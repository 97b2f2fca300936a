#include <string>

#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/distortion.h"

namespace rotslam {
namespace {

bool HasKeyThatBegins(const Section& root, const std::string& beginning) {
  for (const TreeNode& child : root.node().children) {
    if (child.key.starts_with(beginning)) return true;
  }
  return false;
}

// @param lens  "Camera." or "Camera1.": what its numbers' keys begin with.
Camera ReadOrbSlamLens(const Section& root, const std::string& lens) {
  const Section common = root.WithPrefix("Camera.");
  const Section section = root.WithPrefix(lens);
  const std::string type = common.Has("type") ? Lower(common.Text("type")) : "pinhole";
  Camera camera;
  const std::string width = common.Has("width") || !common.Has("cols") ? "width" : "cols";
  ReadSize(common, width, width == "cols" ? "rows" : "height", camera.width, camera.height);
  if (type == "pinhole") {
    if (!common.Has("type") && common.Flag("bFishEye")) {
      common.FailValue("bFishEye",
                       "but no Camera.type says which model; write Camera.type: KannalaBrandt8");
    }
    ReadNamedDistortion(section, CameraModel::kRadtan, {}, camera);
  } else if (type == "rectified") {
    ReadNamedDistortion(section, CameraModel::kPinhole, {}, camera);
  } else if (type == "kannalabrandt8") {
    for (const char* name : {"k1", "k2", "k3", "k4"}) section.Number(name);
    ReadNamedDistortion(section, CameraModel::kEquidistant, {}, camera);
  } else {
    common.FailValue("type", "must be PinHole, Rectified or KannalaBrandt8");
  }
  camera.fx = section.Positive("fx");
  camera.fy = section.Positive("fy");
  camera.cx = section.Number("cx");
  camera.cy = section.Number("cy");
  return camera;
}

// The camera before rectification that ORB-SLAM 2's stereo files carry besides.
Camera ReadUnrectified(const Section& root, const std::string& side) {
  const Section section = root.WithPrefix(side);
  Camera camera;
  ReadSize(section, "width", "height", camera.width, camera.height);
  ReadMatrixAndDistortion(section, "K", section.Has("D") ? "D" : "", false, camera);
  return camera;
}

void NoteResizing(const Section& common, CameraFile& file) {
  if (common.HasAny({"newWidth", "newHeight"})) {
    file.notes.push_back(
        "Camera.newWidth and newHeight are ignored: images are used in their own "
        "size, which the numbers belong to");
  }
  if (common.NumberOr("imageScale", 1.0) != 1.0) {
    file.notes.push_back(
        "Camera.imageScale is ignored: images are used in their own size, which "
        "the numbers belong to");
  }
}

CameraFile ReadOrbSlam(const CameraDocument& document) {
  const Section root = document.root();
  CameraFile file;
  file.first_is_default = true;  // what ORB-SLAM itself takes for the images
  const std::string first = HasKeyThatBegins(root, "Camera1.") ? "Camera1" : "Camera";
  file.Add(first, [&] { return ReadOrbSlamLens(root, first + "."); });
  if (root.Has("Camera2.fx")) {
    file.Add("Camera2", [&] { return ReadOrbSlamLens(root, "Camera2."); });
  }
  for (const std::string side : {"LEFT", "RIGHT"}) {
    if (root.Has(side + ".K")) file.Add(side, [&] { return ReadUnrectified(root, side + "."); });
  }
  if (root.Has("LEFT.K")) {
    file.notes.push_back(first +
                         ".fx and so on belong to rectified images; where the images are "
                         "not, take the camera LEFT or RIGHT of this file");
  }
  NoteResizing(root.WithPrefix("Camera."), file);
  return file;
}

}  // namespace

namespace forms {

CameraForm CameraFormOrbSlam() {
  CameraForm form;
  form.name = "ORB-SLAM YAML";
  form.description =
      "ORB-SLAM 1, 2 and 3: `Camera.fx: 517.3` or `Camera1.fx: 517.3`, `Camera.type`";
  form.recognises = [](const CameraDocument& document) {
    const Section root = document.root();
    return (HasKeyThatBegins(root, "Camera.") || HasKeyThatBegins(root, "Camera1.")) &&
           !root.Has("Camera.model");
  };
  form.read = ReadOrbSlam;
  return form;
}

}  // namespace forms
}  // namespace rotslam
