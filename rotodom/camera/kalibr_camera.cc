#include "rotodom/camera/kalibr_camera.h"

#include <algorithm>
#include <cstddef>
#include <map>
#include <optional>

#include "rotodom/camera/distortion.h"

namespace rotslam {
namespace {

// What Kalibr's projections have before fu fv pu pv.
const std::map<std::string, std::string>& KalibrProjections() {
  static const std::map<std::string, std::string> kProjections = {
      {"pinhole", ""}, {"omni", "xi"}, {"ds", "xi alpha"}, {"eucm", "alpha beta"}};
  return kProjections;
}

void ReadKalibrIntrinsics(const Section& section, Camera& camera) {
  const std::string projection = section.Text("camera_model");
  const auto found = KalibrProjections().find(Lower(projection));
  if (found == KalibrProjections().end()) {
    section.FailValue("camera_model", "which is not supported; must be pinhole");
  }
  const std::string& own = found->second;
  const std::size_t num_own = own.empty() ? 0 : 1 + std::count(own.begin(), own.end(), ' ');
  const std::vector<double> values = section.Numbers(
      "intrinsics", {num_own + 4}, own + (own.empty() ? "fx fy cx cy" : " fx fy cx cy"));
  if (num_own > 0) {
    // The extended unified model is a pinhole where alpha is 0, whatever beta.
    const std::size_t num_zero = projection == "eucm" ? 1 : num_own;
    RequirePinhole(section,
                   "camera_model",
                   projection,
                   {values.begin(), values.begin() + static_cast<std::ptrdiff_t>(num_zero)});
  }
  for (const std::size_t k : {num_own, num_own + 1}) {
    if (values[k] > 0.0) continue;
    section.Fail("intrinsics", "has a focal length that is not positive");
  }
  camera.fx = values[num_own];
  camera.fy = values[num_own + 1];
  camera.cx = values[num_own + 2];
  camera.cy = values[num_own + 3];
}

void ReadKalibrDistortion(const Section& section, Camera& camera) {
  const std::string key = section.FirstOf({"distortion_coeffs", "distortion_coefficients"})
                              .value_or("distortion_coeffs");
  const std::vector<double> values = section.Numbers(key);
  const std::string model =
      section.Has("distortion_model") ? Lower(section.Text("distortion_model")) : "none";
  std::optional<std::string> problem;
  if (model == "radtan" || model == "radial-tangential" || model == "plumb_bob") {
    if (values.empty()) section.Fail(key, "has 0 values, must have 4: k1 k2 p1 p2");
    problem = SetOpenCvDistortion(values, camera);
  } else if (model == "equidistant" || model == "equi" || model == "kannala-brandt") {
    problem = SetFisheyeDistortion(values, camera);
  } else if (model == "fov") {
    problem = SetFovDistortion(values, camera);
  } else if (model == "none") {
    const auto is_zero = [](double value) { return value == 0.0; };
    if (!std::all_of(values.begin(), values.end(), is_zero)) {
      problem = "has values that are not 0, but distortion_model is none or missing";
    }
  } else {
    section.FailValue(
        "distortion_model",
        "which is not supported; must be radtan, radial-tangential, equidistant, fov or none");
  }
  if (problem) section.Fail(key, *problem);
}

}  // namespace

void RequirePinhole(const Section& section,
                    const std::string& key,
                    const std::string& model,
                    const std::vector<double>& own_parameters) {
  const auto is_zero = [](double value) { return value == 0.0; };
  if (std::all_of(own_parameters.begin(), own_parameters.end(), is_zero)) return;
  section.Fail(key,
               "is '" + model +
                   "', which is not supported; calibrate as pinhole with radtan or, for a wide "
                   "lens, equidistant distortion");
}

Camera ReadKalibrCamera(const Section& section) {
  Camera camera;
  ReadKalibrIntrinsics(section, camera);
  ReadKalibrDistortion(section, camera);
  ReadSizeList(section, "resolution", camera.width, camera.height);
  if (section.Has("line_delay")) {
    const double line_delay_s = section.Number("line_delay");
    if (camera.height == 0) {
      section.Fail("line_delay", "is given, but no resolution, which is needed with it");
    }
    camera.readout_s = line_delay_s * (camera.height - 1);
    camera.knows_readout = true;
    if (!(camera.readout_s >= 0.0 && camera.readout_s < 1.0)) {
      section.FailValue("line_delay",
                        "must be the seconds from one row to the next: 0 or more, and below 1 "
                        "second for all rows");
    }
  }
  return camera;
}

}  // namespace rotslam
