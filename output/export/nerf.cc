#include "output/export/nerf.h"

#include <stdexcept>
#include <string_view>

#include <nlohmann/json.hpp>

#include "output/export/lens_fit.h"
#include "output/export/scene_box.h"
#include "output/files/atomic_file.h"
#include "output/map/frame_cameras.h"
#include "output/map/map_keypoints.h"
#include "output/map/ply.h"

namespace rotslam {
namespace {

using Json = nlohmann::ordered_json;

// A refitted OPENCV lens that leaves less than this is taken though a fisheye may leave less still.
constexpr double kGoodFitPx = 0.05;
// What no one would take for the same lens.
constexpr double kNoFitPx = 100.0;

bool HasDenominator(const Camera& camera) {
  const auto& d = camera.distortion;
  return camera.model == CameraModel::kRational && (d[5] != 0.0 || d[6] != 0.0 || d[7] != 0.0);
}

// Whether the readers have a model of the lens.
bool IsReadable(const Camera& camera, NerfReader reader) {
  if (camera.model == CameraModel::kFov || HasDenominator(camera)) return false;
  const bool is_polynomial =
      camera.model == CameraModel::kRadtan || camera.model == CameraModel::kRational;
  return !is_polynomial || reader == NerfReader::kNerfstudio || camera.distortion[4] == 0.0;
}

LensFit RefitForReaders(const Camera& camera, NerfReader reader) {
  const int num_radtan = reader == NerfReader::kNerfstudio ? 5 : 4;
  const LensFit radtan = FitLens(camera, CameraModel::kRadtan, num_radtan);
  if (radtan.rms_px < kGoodFitPx) return radtan;
  const LensFit fisheye = FitLens(camera, CameraModel::kEquidistant, 4);
  return fisheye.rms_px < radtan.rms_px ? fisheye : radtan;
}

// The lens as the readers know it; a refitted one is told in `notes`.
Camera ReadableCamera(const std::filesystem::path& path,
                      const Camera& camera,
                      NerfReader reader,
                      std::vector<std::string>& notes) {
  if (IsReadable(camera, reader)) return camera;
  const LensFit fit = RefitForReaders(camera, reader);
  const bool is_fisheye = fit.camera.model == CameraModel::kEquidistant;
  const std::string model = is_fisheye                          ? "a fisheye (k1 k2 k3 k4)"
                            : reader == NerfReader::kNerfstudio ? "k1 k2 p1 p2 k3"
                                                                : "k1 k2 p1 p2";
  if (!(fit.rms_px < kNoFitPx)) {
    throw std::runtime_error(path.string() +
                             ": is not written: no lens of nerfstudio and instant-ngp comes near "
                             "this one; --undistort writes images without distortion");
  }
  notes.push_back(
      "the readers have no model of the lens (" + std::string(Name(camera.model)) +
      "): it is refitted to " + model + ", which leaves " + DescribeResidual(fit) +
      (fit.largest_px > 1.0 ? "; --undistort writes images without distortion instead" : ""));
  return fit.camera;
}

Json ModelToJson(const Camera& camera) {
  const bool is_fisheye = camera.model == CameraModel::kEquidistant;
  return {{"camera_model", is_fisheye ? "OPENCV_FISHEYE" : "OPENCV"}, {"is_fisheye", is_fisheye}};
}

Json NumbersToJson(const Camera& camera, NerfReader reader) {
  const bool is_fisheye = camera.model == CameraModel::kEquidistant;
  const auto& d = camera.distortion;
  Json json = {{"w", camera.width},
               {"h", camera.height},
               {"fl_x", camera.fx},
               {"fl_y", camera.fy},
               {"cx", camera.cx + 0.5},
               {"cy", camera.cy + 0.5},
               {"k1", d[0]},
               {"k2", d[1]}};
  if (is_fisheye) {
    json["k3"] = d[2];
    json["k4"] = d[3];
    return json;
  }
  json["p1"] = d[2];
  json["p2"] = d[3];
  if (reader == NerfReader::kNerfstudio) json["k3"] = d[4];
  return json;
}

// The readers' camera with the focal length and principal point that a frame's camera has.
Camera ZoomedLike(const Camera& own, const Camera& of_map, Camera readable) {
  readable.fx *= own.fx / of_map.fx;
  readable.fy *= own.fy / of_map.fy;
  readable.cx = own.cx + own.fx / of_map.fx * (readable.cx - of_map.cx);
  readable.cy = own.cy + own.fy / of_map.fy * (readable.cy - of_map.cy);
  return readable;
}

// Rows of `matrix`.
template <int kRows>
Json RowsToJson(const Eigen::Matrix<double, kRows, 4>& matrix) {
  Json rows = Json::array();
  for (int row = 0; row < kRows; ++row) {
    rows.push_back({matrix(row, 0), matrix(row, 1), matrix(row, 2), matrix(row, 3)});
  }
  return rows;
}

Json WorldFromCamera(const MapFrame& frame) {
  Eigen::Matrix4d world_from_cam = Eigen::Matrix4d::Identity();
  Eigen::Matrix3d R_w_c = frame.cam_from_world.Inverse().Matrix();
  R_w_c.rightCols<2>() *= -1.0;
  world_from_cam.topLeftCorner<3, 3>() = R_w_c;
  world_from_cam.topRightCorner<3, 1>() = frame.center_in_world;
  return RowsToJson(world_from_cam);
}

// Of the points that two frames or more explain.
std::vector<CloudPoint> PointsOf(const RunMap& map) {
  Reconstruction reconstruction = ToReconstruction(map);
  std::erase_if(reconstruction.tracks,
                [](const Track& track) { return track.observations.size() < 2; });
  return MakeCloud(reconstruction, map.camera);
}

SceneBox BoxOf(const RunMap& map, const std::vector<CloudPoint>& cloud) {
  std::vector<Eigen::Vector3d> centers;
  for (const MapFrame& frame : map.frames) centers.push_back(frame.center_in_world);
  std::vector<Eigen::Vector3d> points;
  points.reserve(cloud.size());
  for (const CloudPoint& point : cloud) points.push_back(point.point_in_world);
  return ChooseSceneBox(centers, points);
}

// Writes the points beside the file; gives the name.
std::string WritePointsBeside(const std::filesystem::path& path,
                              const std::vector<CloudPoint>& cloud) {
  std::string name = path.stem().string() + "_points.ply";
  WritePly(std::filesystem::path(path).replace_filename(name), cloud);
  return name;
}

}  // namespace

std::vector<std::string> WriteNerfTransforms(const std::filesystem::path& path,
                                             const RunMap& map,
                                             const std::filesystem::path& image_folder,
                                             NerfReader reader) {
  std::vector<std::string> notes;
  const Camera camera = ReadableCamera(path, map.camera, reader, notes);
  std::filesystem::path images = image_folder;
  if (!images.empty()) {
    const std::filesystem::path here = std::filesystem::absolute(path).parent_path();
    images = std::filesystem::absolute(images).lexically_normal().lexically_proximate(
        here.lexically_normal());
  }
  const std::vector<CloudPoint> cloud = PointsOf(map);
  const SceneBox box = BoxOf(map, cloud);
  if (box.num_outside > 0) {
    notes.push_back(std::to_string(box.num_outside) + " of " + std::to_string(cloud.size()) +
                    " points lie too far away for instant-ngp's largest box");
  }
  Json json = ModelToJson(camera);
  // nerfstudio reads those of a frame only where the file has none for all.
  const bool is_alike = map.frame_cameras.empty();
  if (is_alike) json.update(NumbersToJson(camera, reader));
  json["aabb_scale"] = box.aabb_scale;
  json["scale"] = box.scale;
  json["offset"] = {box.offset.x(), box.offset.y(), box.offset.z()};
  json["applied_transform"] = RowsToJson<3>(Eigen::Matrix<double, 3, 4>::Identity());
  if (!cloud.empty()) json["ply_file_path"] = WritePointsBeside(path, cloud);
  json["frames"] = Json::array();
  for (const MapFrame& frame : map.frames) {
    Json& entry = json["frames"].emplace_back();
    entry = {{"file_path", (images / frame.image).generic_string()},
             {"transform_matrix", WorldFromCamera(frame)}};
    if (!is_alike) {
      entry["is_fisheye"] = json["is_fisheye"];
      entry.update(NumbersToJson(ZoomedLike(CameraOf(map, frame.id), map.camera, camera), reader));
    }
  }
  ReplaceFile(path, json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
  return notes;
}

}  // namespace rotslam
