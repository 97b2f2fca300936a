#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/distortion.h"

namespace rotslam {
namespace {

Camera ReadOpenMvgCamera(const Section& data, const std::string& type, const Section& value) {
  Camera camera;
  std::optional<std::string> problem;
  std::string key;
  if (type == "pinhole") {
    camera.model = CameraModel::kPinhole;
  } else if (type == "pinhole_radial_k1") {
    key = "disto_k1";
    const std::vector<double> k = data.Numbers(key, {1}, "k1");
    problem = SetOpenCvDistortion(std::vector<double>{k[0], 0.0, 0.0, 0.0}, camera);
  } else if (type == "pinhole_radial_k3") {
    key = "disto_k3";
    const std::vector<double> k = data.Numbers(key, {3}, "k1 k2 k3");
    problem = SetOpenCvDistortion(std::vector<double>{k[0], k[1], 0.0, 0.0, k[2]}, camera);
  } else if (type == "pinhole_brown_t2") {
    key = "disto_t2";
    const std::vector<double> k = data.Numbers(key, {5}, "k1 k2 k3 t1 t2");
    problem = SetOpenCvDistortion(std::vector<double>{k[0], k[1], k[3], k[4], k[2]}, camera);
  } else if (type == "fisheye") {
    key = "fisheye";
    problem = SetFisheyeDistortion(data.Numbers(key, {4}, "k1 k2 k3 k4"), camera);
  } else {
    FailAt(value.file(),
           value.Line("polymorphic_id"),
           "polymorphic_name is '" + type +
               "', which is not supported; must be pinhole, pinhole_radial_k1, pinhole_radial_k3, "
               "pinhole_brown_t2 or fisheye");
  }
  if (problem) data.Fail(key, *problem);
  ReadSize(data, "width", "height", camera.width, camera.height);
  camera.fx = camera.fy = data.Positive("focal_length");
  const std::vector<double> centre = data.Numbers("principal_point", {2}, "cx cy");
  camera.cx = centre[0];
  camera.cy = centre[1];
  return camera;
}

CameraFile ReadOpenMvg(const CameraDocument& document) {
  // A type has its name where it occurs first, and from then on its number alone.
  constexpr std::uint32_t kNumberBits = 0x7fffffffU;
  const Section root = document.root();
  CameraFile file;
  std::map<std::uint32_t, std::string> types;
  for (const Section& intrinsic : root.Maps("intrinsics")) {
    file.Add(intrinsic.Has("key") ? intrinsic.Text("key") : "", [&] {
      const Section value = intrinsic.Map("value");
      const double id = value.NumberOr("polymorphic_id", 0.0);
      if (!(id >= 0.0 && id < 4294967296.0)) {
        value.FailValue("polymorphic_id", "must be a number of 32 bits");
      }
      const std::uint32_t number = static_cast<std::uint32_t>(id) & kNumberBits;
      if (value.Has("polymorphic_name")) types[number] = value.Text("polymorphic_name");
      return ReadOpenMvgCamera(value.Map("ptr_wrapper").Map("data"), types[number], value);
    });
  }
  if (file.cameras.empty()) root.Fail("intrinsics", "is missing or empty: no camera");
  return file;
}

}  // namespace

namespace forms {

CameraForm CameraFormOpenmvg() {
  CameraForm form;
  form.name = "openMVG sfm_data.json";
  form.description = "JSON with `sfm_data_version` and `intrinsics`";
  form.file_names = {"sfm_data.json"};
  form.recognises = [](const CameraDocument& document) {
    return document.root().Has("sfm_data_version");
  };
  form.read = ReadOpenMvg;
  return form;
}

}  // namespace forms
}  // namespace rotslam
