#include "output/export/nerf.h"

#include <nlohmann/json.hpp>

#include "output/export/distortion_json.h"
#include "output/files/atomic_file.h"

namespace rotslam {
namespace {

using Json = nlohmann::ordered_json;

Json CameraToJson(const Camera& camera) {
  const bool is_fisheye = camera.model == CameraModel::kEquidistant;
  Json json = {{"camera_model", is_fisheye ? "OPENCV_FISHEYE" : "OPENCV"},
               {"is_fisheye", is_fisheye},
               {"w", camera.width},
               {"h", camera.height},
               {"fl_x", camera.fx},
               {"fl_y", camera.fy},
               {"cx", camera.cx + 0.5},
               {"cy", camera.cy + 0.5}};
  AddDistortion(camera, json);
  return json;
}

// Four rows of four.
Json WorldFromCamera(const MapFrame& frame) {
  Eigen::Matrix3d R_w_c = frame.cam_from_world.Inverse().Matrix();
  R_w_c.rightCols<2>() *= -1.0;
  Json rows = Json::array();
  for (int row = 0; row < 3; ++row) {
    rows.push_back({R_w_c(row, 0), R_w_c(row, 1), R_w_c(row, 2), frame.center_in_world[row]});
  }
  rows.push_back({0.0, 0.0, 0.0, 1.0});
  return rows;
}

}  // namespace

void WriteNerfTransforms(const std::filesystem::path& path,
                         const RunMap& map,
                         const std::filesystem::path& image_folder) {
  RefuseLensBeyondRadtan(path, map.camera, "nerfstudio");
  std::filesystem::path images = image_folder;
  if (!images.empty()) {
    const std::filesystem::path here = std::filesystem::absolute(path).parent_path();
    images = std::filesystem::absolute(images).lexically_normal().lexically_proximate(
        here.lexically_normal());
  }
  Json json = CameraToJson(map.camera);
  json["frames"] = Json::array();
  for (const MapFrame& frame : map.frames) {
    json["frames"].push_back({{"file_path", (images / frame.image).generic_string()},
                              {"transform_matrix", WorldFromCamera(frame)}});
  }
  ReplaceFile(path, json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace rotslam
