#include <string>

#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/distortion.h"

namespace rotslam {
namespace {

Camera ReadStella(const Section& section) {
  const std::string model = Lower(section.Text("model"));
  if (model == "equirectangular") {
    section.FailValue("model",
                      "which is not supported; cut perspective images out of the panoramas "
                      "(ffmpeg -vf v360=equirect:flat) and give the camera of those");
  }
  if (model == "radial_division") {
    section.FailValue("model", "which is not supported; calibrate as perspective or fisheye");
  }
  Camera camera;
  const std::string width = section.Has("cols") || !section.Has("width") ? "cols" : "width";
  ReadSize(section, width, width == "cols" ? "rows" : "height", camera.width, camera.height);
  camera.fx = section.Positive("fx");
  camera.fy = section.Positive("fy");
  camera.cx = section.Number("cx");
  camera.cy = section.Number("cy");
  if (model == "perspective") {
    ReadNamedDistortion(section, CameraModel::kRadtan, {"distortion"}, camera);
  } else if (model == "fisheye") {
    ReadNamedDistortion(section, CameraModel::kEquidistant, {"distortion"}, camera);
  } else {
    section.FailValue("model", "must be perspective or fisheye");
  }
  return camera;
}

}  // namespace

namespace forms {

CameraForm CameraFormStellaVslam() {
  CameraForm form;
  form.name = "stella_vslam YAML";
  form.description =
      "stella_vslam and OpenVSLAM: `Camera.model: perspective` or `fisheye`, or `Camera:` with "
      "`model`, `fx`, ... below it";
  form.recognises = [](const CameraDocument& document) {
    const Section root = document.root();
    return root.HasMap("Camera") || root.Has("Camera.model");
  };
  form.read = [](const CameraDocument& document) {
    const Section root = document.root();
    CameraFile file;
    const Section section = root.HasMap("Camera") ? root.Map("Camera") : root.WithPrefix("Camera.");
    file.cameras.push_back({"", ReadStella(section), {}, ""});
    return file;
  };
  return form;
}

}  // namespace forms
}  // namespace rotslam
