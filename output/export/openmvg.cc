#include "output/export/openmvg.h"

#include <cstdint>

#include <nlohmann/json.hpp>

#include "output/export/distortion_json.h"
#include "output/files/atomic_file.h"
#include "output/map/frame_cameras.h"
#include "output/map/map_keypoints.h"

namespace rotslam {
namespace {

using Json = nlohmann::ordered_json;

// openMVG's archive numbers the objects behind its pointers; the highest bit says that the object
// itself follows.
constexpr std::uint32_t kNewObject = 0x80000000U;
// In place of a type's number: the object is of the type that the pointer says.
constexpr std::uint32_t kDeclaredType = 0x40000000U;

// @param intrinsic  position among the cameras.
Json ViewToJson(const MapFrame& frame, const Camera& camera, int intrinsic, std::uint32_t number) {
  const Json data = {{"local_path", ""},
                     {"filename", frame.image},
                     {"width", camera.width},
                     {"height", camera.height},
                     {"id_view", frame.id.value},
                     {"id_intrinsic", intrinsic},
                     {"id_pose", frame.id.value}};
  return {{"key", frame.id.value},
          {"value",
           {{"polymorphic_id", kDeclaredType},
            {"ptr_wrapper", {{"id", kNewObject + number}, {"data", data}}}}}};
}

Json IntrinsicToJson(const Camera& camera, int key, std::uint32_t number) {
  Json data = {{"width", camera.width},
               {"height", camera.height},
               {"focal_length", camera.MeanFocal()},
               {"principal_point", {camera.cx, camera.cy}}};
  const auto& d = camera.distortion;
  std::string type = "pinhole";
  if (camera.model == CameraModel::kRadtan || camera.model == CameraModel::kRational) {
    type = "pinhole_brown_t2";
    data["disto_t2"] = {d[0], d[1], d[4], d[2], d[3]};
  } else if (camera.model == CameraModel::kEquidistant) {
    type = "fisheye";
    data["fisheye"] = {d[0], d[1], d[2], d[3]};
  }
  Json value = {{"polymorphic_id", key == 0 ? kNewObject + 1 : 1}};
  // Its name stands where it comes first.
  if (key == 0) value["polymorphic_name"] = type;
  value["ptr_wrapper"] = {{"id", kNewObject + number}, {"data", data}};
  return {{"key", key}, {"value", value}};
}

Json PoseToJson(const MapFrame& frame) {
  const Eigen::Matrix3d R_c_w = frame.cam_from_world.Matrix();
  Json rotation = Json::array();
  for (int row = 0; row < 3; ++row) {
    rotation.push_back({R_c_w(row, 0), R_c_w(row, 1), R_c_w(row, 2)});
  }
  const Eigen::Vector3d& center = frame.center_in_world;
  return {{"key", frame.id.value},
          {"value", {{"rotation", rotation}, {"center", {center.x(), center.y(), center.z()}}}}};
}

Json PointToJson(const MapTrack& entry, const std::vector<int>& numbers) {
  Json observations = Json::array();
  for (std::size_t k = 0; k < entry.fits.size(); ++k) {
    if (!entry.fits[k]) continue;
    const Observation& seen = entry.track.observations[k];
    const Json value = {{"id_feat", numbers[k]},
                        {"x", {seen.keypoint_px.x(), seen.keypoint_px.y()}}};
    observations.push_back({{"key", seen.frame.value}, {"value", value}});
  }
  const Eigen::Vector3d& point = *entry.point_in_world;
  return {{"key", entry.track.id.value},
          {"value", {{"X", {point.x(), point.y(), point.z()}}, {"observations", observations}}}};
}

}  // namespace

void WriteOpenMvg(const std::filesystem::path& path,
                  const RunMap& map,
                  const std::filesystem::path& image_folder) {
  RefuseLensBeyondRadtan(path, map.camera, "openMVG");
  std::filesystem::path root = image_folder;
  if (!root.empty()) root = std::filesystem::absolute(root).lexically_normal();
  Json json = {{"sfm_data_version", "0.3"}, {"root_path", root.string()}};
  for (const char* part : {"views", "intrinsics", "extrinsics", "structure", "control_points"}) {
    json[part] = Json::array();
  }
  const CameraList cameras = ListCameras(map);
  std::uint32_t number = 0;
  for (const MapFrame& frame : map.frames) {
    const int intrinsic = cameras.of_frame.at(frame.id);
    json["views"].push_back(ViewToJson(frame, cameras.cameras[intrinsic], intrinsic, ++number));
    json["extrinsics"].push_back(PoseToJson(frame));
  }
  for (std::size_t k = 0; k < cameras.cameras.size(); ++k) {
    json["intrinsics"].push_back(
        IntrinsicToJson(cameras.cameras[k], static_cast<int>(k), ++number));
  }
  const std::vector<std::vector<int>> numbers = NumberKeypoints(map);
  for (std::size_t t = 0; t < map.tracks.size(); ++t) {
    if (HasPoint(map.tracks[t])) {
      json["structure"].push_back(PointToJson(map.tracks[t], numbers[t]));
    }
  }
  ReplaceFile(path, json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace rotslam
