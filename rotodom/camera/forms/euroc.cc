#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/kalibr_camera.h"

namespace rotslam {
namespace forms {

CameraForm CameraFormEuroc() {
  CameraForm form;
  form.name = "EuRoC sensor.yaml";
  form.description =
      "`camera_model: pinhole`, `intrinsics`, `distortion_model: radial-tangential`, "
      "`distortion_coefficients`";
  form.file_names = {"sensor.yaml", "mav0/cam0/sensor.yaml"};
  form.recognises = [](const CameraDocument& document) {
    const Section root = document.root();
    return root.HasAny({"camera_model", "intrinsics"}) && !root.HasAny({"sfm_data_version",
                                                                        "fl_x",
                                                                        "camera_angle_x",
                                                                        "frames",
                                                                        "camera_matrix",
                                                                        "model_type",
                                                                        "value0"});
  };
  form.read = [](const CameraDocument& document) {
    CameraFile file;
    file.cameras.push_back({"", ReadKalibrCamera(document.root()), {}, ""});
    return file;
  };
  return form;
}

}  // namespace forms
}  // namespace rotslam
