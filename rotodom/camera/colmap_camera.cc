#include "rotodom/camera/colmap_camera.h"

#include <algorithm>
#include <array>
#include <cstddef>

#include "rotodom/camera/distortion.h"
#include "rotodom/camera/section.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

std::string MustBeZero(const std::string& key, const std::string& text, const std::string& model) {
  return key + " is " + text + ", but " + model +
         " is supported only where it is 0; calibrate as OPENCV_FISHEYE";
}

constexpr std::array<ColmapModelId, 12> kModelIds = {{{0, "SIMPLE_PINHOLE", 3},
                                                      {1, "PINHOLE", 4},
                                                      {2, "SIMPLE_RADIAL", 4},
                                                      {3, "RADIAL", 5},
                                                      {4, "OPENCV", 8},
                                                      {5, "OPENCV_FISHEYE", 8},
                                                      {6, "FULL_OPENCV", 12},
                                                      {7, "FOV", 5},
                                                      {8, "SIMPLE_RADIAL_FISHEYE", 4},
                                                      {9, "RADIAL_FISHEYE", 5},
                                                      {10, "THIN_PRISM_FISHEYE", 12},
                                                      {11, "RAD_TAN_THIN_PRISM_FISHEYE", 16}}};

// The parameters of a COLMAP model in their order. f is fx and fy at once; a name with a '!' has to
// be zero for us to be able to read it.
struct ColmapModel {
  const char* name;
  CameraModel model;
  std::vector<std::string> parameters;
};

const std::vector<ColmapModel>& ColmapModels() {
  constexpr CameraModel kFisheye = CameraModel::kEquidistant;
  static const std::vector<ColmapModel> kModels = {
      {"SIMPLE_PINHOLE", CameraModel::kPinhole, {"f", "cx", "cy"}},
      {"PINHOLE", CameraModel::kPinhole, {"fx", "fy", "cx", "cy"}},
      {"SIMPLE_RADIAL", CameraModel::kRadtan, {"f", "cx", "cy", "k1"}},
      {"RADIAL", CameraModel::kRadtan, {"f", "cx", "cy", "k1", "k2"}},
      {"OPENCV", CameraModel::kRadtan, {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"}},
      {"FULL_OPENCV",
       CameraModel::kRational,
       {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}},
      {"FOV", CameraModel::kFov, {"fx", "fy", "cx", "cy", "w"}},
      {"SIMPLE_FISHEYE", kFisheye, {"f", "cx", "cy"}},
      {"FISHEYE", kFisheye, {"fx", "fy", "cx", "cy"}},
      {"SIMPLE_RADIAL_FISHEYE", kFisheye, {"f", "cx", "cy", "k1"}},
      {"RADIAL_FISHEYE", kFisheye, {"f", "cx", "cy", "k1", "k2"}},
      {"OPENCV_FISHEYE", kFisheye, {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"}},
      {"THIN_PRISM_FISHEYE",
       kFisheye,
       {"fx", "fy", "cx", "cy", "k1", "k2", "!p1", "!p2", "k3", "k4", "!sx1", "!sy1"}},
      {"RAD_TAN_THIN_PRISM_FISHEYE",
       kFisheye,
       {"fx",
        "fy",
        "cx",
        "cy",
        "k1",
        "k2",
        "k3",
        "k4",
        "!k4, the fifth radial term,",
        "!k5, the sixth radial term,",
        "!p0",
        "!p1",
        "!s0",
        "!s1",
        "!s2",
        "!s3"}}};
  return kModels;
}

std::string KnownColmapModels() {
  std::string known;
  for (const ColmapModel& model : ColmapModels()) {
    known.append(known.empty() ? "" : ", ").append(model.name);
  }
  return known;
}

}  // namespace

const ColmapModelId* FindColmapModel(int id) {
  const auto found = std::find_if(
      kModelIds.begin(), kModelIds.end(), [&](const auto& model) { return model.id == id; });
  return found == kModelIds.end() ? nullptr : &*found;
}

Camera ReadColmapCamera(const fs::path& file, const std::vector<std::string>& words, int line) {
  const std::string who = "camera " + (words.empty() ? "" : words[0]) + ": ";
  if (words.size() < 4) FailAt(file, line, who + "must have at least id, model, width and height");
  const auto& models = ColmapModels();
  const auto found = std::find_if(models.begin(), models.end(), [&](const ColmapModel& model) {
    return words[1] == model.name;
  });
  if (found == models.end()) {
    FailAt(file,
           line,
           who + "model is '" + words[1] + "', which is not supported; known are " +
               KnownColmapModels());
  }
  const std::size_t num_given = words.size() - 4;
  if (num_given != found->parameters.size()) {
    FailAt(file,
           line,
           who + found->name + " has " + std::to_string(num_given) + " parameters, must have " +
               std::to_string(found->parameters.size()));
  }
  Camera camera;
  camera.model = found->model;
  camera.width = PixelCount(file, line, who + "width", words[2]);
  camera.height = PixelCount(file, line, who + "height", words[3]);
  if ((camera.width == 0) != (camera.height == 0)) {
    FailAt(file, line, who + "one of width and height is 0, must be positive");
  }
  const auto names = DistortionNames(camera.model);
  for (std::size_t k = 0; k < num_given; ++k) {
    const std::string& name = found->parameters[k];
    const std::string& text = words[4 + k];
    const bool must_be_zero = name.front() == '!';
    const std::string key = who + (must_be_zero ? name.substr(1) : name);
    const bool is_focal = name == "f" || name == "fx" || name == "fy";
    const double value =
        is_focal ? PositiveNumber(file, line, key, text) : FiniteNumber(file, line, key, text);
    if (must_be_zero && value != 0.0) {
      FailAt(file, line, MustBeZero(key, text, found->name));
    }
    if (name == "f" || name == "fx") camera.fx = value;
    if (name == "f" || name == "fy") camera.fy = value;
    if (name == "cx") camera.cx = value - 0.5;
    if (name == "cy") camera.cy = value - 0.5;
    for (std::size_t n = 0; n < names.size(); ++n) {
      if (name == names[n]) camera.distortion[n] = value;
    }
    if (name != "w") continue;
    if (const auto problem = SetFovDistortion({&value, 1}, camera))
      FailAt(file, line, key + " " + *problem);
  }
  return Simplified(camera);
}

}  // namespace rotslam
