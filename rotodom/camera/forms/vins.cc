#include <string>
#include <vector>

#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/distortion.h"
#include "rotodom/camera/kalibr_camera.h"

namespace rotslam {
namespace {

// Keys under which VINS-Fusion names the files of its cameras.
const std::vector<std::string> kCalibrationFileKeys = {"cam0_calib", "cam1_calib"};

void ReadVinsProjection(const Section& projection,
                        const std::vector<std::string>& keys,
                        Camera& camera) {
  camera.fx = projection.Positive(keys[0]);
  camera.fy = projection.Positive(keys[1]);
  camera.cx = projection.Number(keys[2]);
  camera.cy = projection.Number(keys[3]);
}

// VINS gives the seconds that a frame takes, its last row included.
void ReadVinsReadout(const Section& root, Camera& camera) {
  if (!root.Flag("rolling_shutter")) return;
  const double frame_s = root.Number("rolling_shutter_tr");
  if (!(frame_s >= 0.0 && frame_s < 1.0)) {
    root.FailValue("rolling_shutter_tr", "must be 0 or more and below 1 second");
  }
  camera.readout_s = camera.height > 0 ? frame_s * (camera.height - 1) / camera.height : frame_s;
  camera.knows_readout = true;
}

Camera ReadVins(const Section& root) {
  if (!root.Has("projection_parameters")) {
    if (const auto key = root.FirstOf(kCalibrationFileKeys)) {
      root.FailValue(*key, "the file with the camera; give that one");
    }
  }
  const std::string model = Lower(root.Text("model_type"));
  Camera camera;
  ReadSize(root, "image_width", "image_height", camera.width, camera.height);
  if (model != "pinhole" && model != "pinhole_full" && model != "kannala_brandt" &&
      model != "mei") {
    root.FailValue("model_type",
                   "which is not supported; must be PINHOLE, PINHOLE_FULL or KANNALA_BRANDT");
  }
  const Section projection = root.Map("projection_parameters");
  if (model == "mei") {
    const double xi =
        root.Has("mirror_parameters") ? root.Map("mirror_parameters").Number("xi") : 0.0;
    RequirePinhole(root, "model_type", root.Text("model_type"), {xi});
    ReadVinsProjection(projection, {"gamma1", "gamma2", "u0", "v0"}, camera);
  } else if (model == "kannala_brandt") {
    ReadVinsProjection(projection, {"mu", "mv", "u0", "v0"}, camera);
    const std::vector<double> k = {projection.Number("k2"),
                                   projection.Number("k3"),
                                   projection.Number("k4"),
                                   projection.Number("k5")};
    if (const auto problem = SetFisheyeDistortion(k, camera)) projection.Fail("k2", *problem);
  } else {
    ReadVinsProjection(projection, {"fx", "fy", "cx", "cy"}, camera);
  }
  if (root.Has("distortion_parameters") && model != "kannala_brandt") {
    ReadNamedDistortion(root.Map("distortion_parameters"), CameraModel::kRadtan, {}, camera);
  } else if (model != "kannala_brandt") {
    camera.model = CameraModel::kPinhole;
  }
  ReadVinsReadout(root, camera);
  return camera;
}

}  // namespace

namespace forms {

CameraForm CameraFormVins() {
  CameraForm form;
  form.name = "VINS YAML";
  form.description =
      "VINS-Mono, VINS-Fusion and camodocal: `model_type: PINHOLE` or `KANNALA_BRANDT`, "
      "`projection_parameters`, `distortion_parameters`";
  form.recognises = [](const CameraDocument& document) {
    const Section root = document.root();
    return root.HasAny({"model_type", "projection_parameters"}) ||
           root.HasAny(kCalibrationFileKeys);
  };
  form.read = [](const CameraDocument& document) {
    CameraFile file;
    file.cameras.push_back({"", ReadVins(document.root()), {}, ""});
    return file;
  };
  return form;
}

}  // namespace forms
}  // namespace rotslam
