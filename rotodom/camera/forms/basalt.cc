#include <string>
#include <vector>

#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/distortion.h"
#include "rotodom/camera/kalibr_camera.h"

namespace rotslam {
namespace {

Camera ReadBasaltCamera(const Section& camera_section) {
  const std::string type = Lower(camera_section.Text("camera_type"));
  const Section numbers = camera_section.Map("intrinsics");
  Camera camera;
  if (type == "pinhole") {
    ReadNamedDistortion(numbers, CameraModel::kPinhole, {}, camera);
  } else if (type == "kb4") {
    for (const char* key : {"k1", "k2", "k3", "k4"}) numbers.Number(key);
    ReadNamedDistortion(numbers, CameraModel::kEquidistant, {}, camera);
  } else if (type == "pinhole-radtan8" || type == "pinhole-radtan5" || type == "pinhole-radtan4") {
    ReadNamedDistortion(numbers, CameraModel::kRadtan, {}, camera);
  } else if (type == "ds") {
    RequirePinhole(
        camera_section, "camera_type", type, {numbers.Number("xi"), numbers.Number("alpha")});
  } else if (type == "eucm" || type == "ucm") {
    RequirePinhole(camera_section, "camera_type", type, {numbers.Number("alpha")});
  } else {
    camera_section.FailValue("camera_type",
                             "which is not supported; must be pinhole, kb4 or pinhole-radtan8");
  }
  camera.fx = numbers.Positive("fx");
  camera.fy = numbers.Positive("fy");
  camera.cx = numbers.Number("cx");
  camera.cy = numbers.Number("cy");
  return camera;
}

CameraFile ReadBasalt(const CameraDocument& document) {
  const Section root = document.root().Map("value0");
  const std::vector<double> sizes = root.Numbers("resolution");
  const std::vector<Section> cameras = root.Maps("intrinsics");
  if (cameras.empty()) root.Fail("intrinsics", "is missing or empty: no camera");
  if (!sizes.empty() && sizes.size() != 2 * cameras.size()) {
    root.Fail("resolution",
              "has " + std::to_string(sizes.size()) +
                  " numbers, must have a width and height for " + std::to_string(cameras.size()) +
                  " cameras");
  }
  CameraFile file;
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    file.Add("cam" + std::to_string(k), [&] {
      Camera camera = ReadBasaltCamera(cameras[k]);
      if (sizes.empty()) return camera;
      for (const double size : {sizes[2 * k], sizes[2 * k + 1]}) {
        if (!(size > 0.0 && size <= 1e6 && size == static_cast<int>(size))) {
          root.Fail("resolution", "must be whole numbers of pixels: [[width, height], ...]");
        }
      }
      camera.width = static_cast<int>(sizes[2 * k]);
      camera.height = static_cast<int>(sizes[2 * k + 1]);
      return camera;
    });
  }
  return file;
}

}  // namespace

namespace forms {

CameraForm CameraFormBasalt() {
  CameraForm form;
  form.name = "Basalt calibration";
  form.description =
      "JSON with `value0`, below it `intrinsics` with `camera_type` pinhole, kb4 or "
      "pinhole-radtan8, and `resolution`";
  form.recognises = [](const CameraDocument& document) {
    const Section root = document.root();
    return root.HasMap("value0") && root.Map("value0").HasAny({"intrinsics", "resolution"});
  };
  form.read = ReadBasalt;
  return form;
}

}  // namespace forms
}  // namespace rotslam
