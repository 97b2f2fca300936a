#include <cmath>
#include <numbers>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/distortion.h"

namespace rotslam {
namespace {

const std::vector<std::string>& NerfKeys() {
  static const std::vector<std::string> kKeys = {"fl_x",
                                                 "fl_y",
                                                 "cx",
                                                 "cy",
                                                 "w",
                                                 "h",
                                                 "camera_angle_x",
                                                 "camera_model",
                                                 "k1",
                                                 "k2",
                                                 "k3",
                                                 "k4",
                                                 "p1",
                                                 "p2"};
  return kKeys;
}

// The numbers of a frame, which may stand with it or once for all.
class NerfFrame {
 public:
  NerfFrame(const Section& root, const Section& frame) : root_(root), frame_(frame) {}

  const Section& Of(const std::string& key) const { return frame_.Has(key) ? frame_ : root_; }
  bool Has(const std::string& key) const { return Of(key).Has(key); }
  double Number(const std::string& key) const { return Of(key).Number(key); }

 private:
  const Section& root_;
  const Section& frame_;
};

double HalfAngleTangent(const NerfFrame& frame, const std::string& key) {
  const double angle_rad = frame.Number(key);
  if (!(angle_rad > 0.0 && angle_rad < std::numbers::pi)) {
    frame.Of(key).FailValue(key, "must be an angle of view from 0 to pi radians");
  }
  return std::tan(0.5 * angle_rad);
}

// OpenCV's names of nerfstudio's models; lenses of one or two coefficients have the others at zero.
CameraModel NerfModel(const NerfFrame& frame) {
  for (const std::string key : {"is_fisheye", "latlong", "equirectangular", "ftheta_p0"}) {
    if (!frame.Has(key) || frame.Number(key) == 0.0) continue;
    if (key == "is_fisheye") return CameraModel::kEquidistant;
    frame.Of(key).Fail(key, "asks for a lens that is not supported");
  }
  if (!frame.Has("camera_model")) return CameraModel::kRadtan;
  const Section& section = frame.Of("camera_model");
  const std::string model = section.Text("camera_model");
  if (model == "PINHOLE" || model == "SIMPLE_PINHOLE") return CameraModel::kPinhole;
  if (model == "OPENCV" || model == "FULL_OPENCV" || model == "SIMPLE_RADIAL" ||
      model == "RADIAL" || model == "PERSPECTIVE") {
    return CameraModel::kRadtan;
  }
  if (model == "OPENCV_FISHEYE" || model == "FISHEYE" || model == "SIMPLE_RADIAL_FISHEYE" ||
      model == "RADIAL_FISHEYE") {
    return CameraModel::kEquidistant;
  }
  section.FailValue(
      "camera_model",
      "which is not supported; must be PINHOLE, OPENCV or OPENCV_FISHEYE, or one of their simpler "
      "kinds");
}

void ReadNerfDistortion(const NerfFrame& frame, Camera& camera) {
  const CameraModel model = NerfModel(frame);
  std::vector<double> k;
  for (const char* key : {"k1", "k2", "p1", "p2", "k3", "k4"}) {
    k.push_back(frame.Has(key) ? frame.Number(key) : 0.0);
  }
  const auto refuse = [&](const std::vector<std::string>& keys, const std::string& reason) {
    for (const std::string& key : keys) {
      if (frame.Has(key) && frame.Number(key) != 0.0) frame.Of(key).FailValue(key, reason);
    }
  };
  if (model == CameraModel::kPinhole) {
    refuse({"k1", "k2", "k3", "k4", "p1", "p2"},
           "but camera_model says PINHOLE; make it OPENCV, or the coefficient 0");
    camera.model = model;
  } else if (model == CameraModel::kEquidistant) {
    refuse({"p1", "p2"},
           "but a fisheye lens has k1 k2 k3 k4 alone; if these are k1 k2 p1 p2, camera_model must "
           "be OPENCV");
    camera.model = model;
    camera.distortion = {k[0], k[1], k[4], k[5]};
  } else {
    refuse({"k4"}, "a term of the eighth order, which is not supported");
    camera.model = model;
    camera.distortion = {k[0], k[1], k[2], k[3], k[4]};
    camera = Simplified(camera);
  }
}

// Pixel centres are at one half there: cx and cy lose 0.5.
NamedCamera ReadNerfCamera(const NerfFrame& frame) {
  NamedCamera named;
  Camera& camera = named.camera;
  for (const auto& [key, other, size] :
       {std::tuple{"w", "h", &camera.width}, std::tuple{"h", "w", &camera.height}}) {
    *size = frame.Of(key).PixelsOrZero(key);
    if (*size == 0 && frame.Has(other)) frame.Of(other).Fail(key, "is missing or 0");
  }
  ReadNerfDistortion(frame, camera);
  const bool has_size = camera.width > 0;
  if (frame.Has("fl_x") || frame.Has("fl_y")) {
    const std::string x = frame.Has("fl_x") ? "fl_x" : "fl_y";
    const std::string y = frame.Has("fl_y") ? "fl_y" : "fl_x";
    camera.fx = frame.Of(x).Positive(x);
    camera.fy = frame.Of(y).Positive(y);
  } else {
    const double tangent = HalfAngleTangent(frame, "camera_angle_x");
    if (!has_size) {
      if (frame.Has("cx") || frame.Has("cy") || frame.Has("camera_angle_y")) {
        frame.Of("camera_angle_x")
            .Fail("camera_angle_x", "is given without w and h, the size of the images; add them");
      }
      named.view_angle_x_rad = frame.Number("camera_angle_x");
      return named;
    }
    camera.fx = camera.fy = 0.5 * camera.width / tangent;
    if (frame.Has("camera_angle_y")) {
      camera.fy = 0.5 * camera.height / HalfAngleTangent(frame, "camera_angle_y");
    }
  }
  if (!has_size) frame.Of("cx").Number("cx");
  if (!has_size) frame.Of("cy").Number("cy");
  camera.cx = (frame.Has("cx") ? frame.Number("cx") : 0.5 * camera.width) - 0.5;
  camera.cy = (frame.Has("cy") ? frame.Number("cy") : 0.5 * camera.height) - 0.5;
  return named;
}

bool SameCamera(const NamedCamera& a, const NamedCamera& b) {
  return a.camera == b.camera && a.view_angle_x_rad == b.view_angle_x_rad;
}

CameraFile ReadNerfstudio(const CameraDocument& document) {
  const Section root = document.root();
  CameraFile file;
  // Cameras that differ are named by the first image that each belongs to.
  if (root.HasList("frames")) {
    for (const Section& frame : root.Maps("frames")) {
      if (!frame.HasAny(NerfKeys())) continue;
      NamedCamera camera = ReadNerfCamera(NerfFrame(root, frame));
      if (frame.Has("file_path")) camera.name = frame.Text("file_path");
      if (!file.cameras.empty() && SameCamera(camera, file.cameras.back())) continue;
      file.cameras.push_back(std::move(camera));
    }
  }
  if (file.cameras.size() == 1) file.cameras[0].name = "";
  if (file.cameras.empty()) file.cameras.push_back(ReadNerfCamera(NerfFrame(root, root)));
  if (file.cameras.size() == 1 && file.cameras[0].view_angle_x_rad) {
    file.notes.push_back(
        "focal length from camera_angle_x and the width of the images, principal "
        "point in their middle");
  }
  return file;
}

}  // namespace

namespace forms {

CameraForm CameraFormNerfstudio() {
  CameraForm form;
  form.name = "nerfstudio transforms.json";
  form.description =
      "nerfstudio, instant-ngp and Blender: JSON with `fl_x`, `cx`, `k1`, `camera_model` or "
      "`camera_angle_x`, and `frames`";
  form.file_names = {"transforms.json", "transforms_train.json"};
  form.recognises = [](const CameraDocument& document) {
    const Section root = document.root();
    return root.HasAny({"fl_x", "camera_angle_x"}) || root.HasList("frames");
  };
  form.read = ReadNerfstudio;
  return form;
}

}  // namespace forms
}  // namespace rotslam
