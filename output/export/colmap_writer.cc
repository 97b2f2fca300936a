#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "output/export/colmap_model.h"
#include "output/files/atomic_file.h"
#include "output/files/binary_file.h"
#include "output/map/map_keypoints.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

constexpr double kPixelCentre = 0.5;

std::array<double, 7> PoseNumbers(const MapFrame& frame) {
  const Eigen::Quaterniond& q = frame.cam_from_world.Quaternion();
  const Eigen::Vector3d t = -(frame.cam_from_world * frame.center_in_world);
  return {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()};
}

std::size_t CountPoints(const RunMap& map) {
  std::size_t count = 0;
  for (const MapTrack& entry : map.tracks) count += HasPoint(entry);
  return count;
}

std::string BinaryCameras(const RunMap& map) {
  const ColmapCamera camera = ToColmap(map.camera);
  BinaryWriter writer;
  writer.Put(std::uint64_t{1});
  writer.Put(std::uint32_t{kColmapCameraId});
  writer.Put(static_cast<std::int32_t>(camera.model_id));
  writer.Put(static_cast<std::uint64_t>(map.camera.width));
  writer.Put(static_cast<std::uint64_t>(map.camera.height));
  for (const double value : camera.parameters) writer.Put(value);
  return writer.bytes();
}

std::string BinaryImages(const RunMap& map,
                         const std::map<FrameId, std::vector<MapKeypoint>>& keypoints) {
  BinaryWriter writer;
  writer.Put(static_cast<std::uint64_t>(map.frames.size()));
  for (const MapFrame& frame : map.frames) {
    writer.Put(static_cast<std::uint32_t>(ColmapImageId(frame.id)));
    for (const double value : PoseNumbers(frame)) writer.Put(value);
    writer.Put(std::uint32_t{kColmapCameraId});
    writer.PutName(frame.image);
    const std::vector<MapKeypoint>& list = keypoints.at(frame.id);
    writer.Put(static_cast<std::uint64_t>(list.size()));
    for (const MapKeypoint& keypoint : list) {
      const Track& track = map.tracks[keypoint.track].track;
      const Eigen::Vector2d& keypoint_px = track.observations[keypoint.observation].keypoint_px;
      writer.Put(keypoint_px.x() + kPixelCentre);
      writer.Put(keypoint_px.y() + kPixelCentre);
      writer.Put(keypoint.has_point ? static_cast<std::uint64_t>(ColmapPointId(track.id))
                                    : std::numeric_limits<std::uint64_t>::max());
    }
  }
  return writer.bytes();
}

std::string BinaryPoints(const RunMap& map, const std::vector<std::vector<int>>& numbers) {
  BinaryWriter writer;
  writer.Put(static_cast<std::uint64_t>(CountPoints(map)));
  for (std::size_t t = 0; t < map.tracks.size(); ++t) {
    const MapTrack& entry = map.tracks[t];
    if (!HasPoint(entry)) continue;
    writer.Put(static_cast<std::uint64_t>(ColmapPointId(entry.track.id)));
    for (const double value : *entry.point_in_world) writer.Put(value);
    for (const std::uint8_t value : entry.track.rgb) writer.Put(value);
    writer.Put(MeanErrorPx(map, entry));
    writer.Put(static_cast<std::uint64_t>(CountFits(entry)));
    for (std::size_t k = 0; k < entry.fits.size(); ++k) {
      if (!entry.fits[k]) continue;
      writer.Put(static_cast<std::uint32_t>(ColmapImageId(entry.track.observations[k].frame)));
      writer.Put(static_cast<std::uint32_t>(numbers[t][k]));
    }
  }
  return writer.bytes();
}

void Add(std::string& text, double value) { text += FormatNumber(" %.17g", value); }

std::string TextCameras(const RunMap& map) {
  const ColmapCamera camera = ToColmap(map.camera);
  std::string text = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS\n" +
                     std::to_string(kColmapCameraId) + " " + camera.model + " " +
                     std::to_string(map.camera.width) + " " + std::to_string(map.camera.height);
  for (const double value : camera.parameters) Add(text, value);
  return text + "\n";
}

std::string TextImages(const RunMap& map,
                       const std::map<FrameId, std::vector<MapKeypoint>>& keypoints) {
  std::string text =
      "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then X Y POINT3D_ID of its keypoints\n";
  for (const MapFrame& frame : map.frames) {
    text += std::to_string(ColmapImageId(frame.id));
    for (const double value : PoseNumbers(frame)) Add(text, value);
    text += " " + std::to_string(kColmapCameraId) + " " + frame.image + "\n";
    std::string line;
    for (const MapKeypoint& keypoint : keypoints.at(frame.id)) {
      const Track& track = map.tracks[keypoint.track].track;
      const Eigen::Vector2d& keypoint_px = track.observations[keypoint.observation].keypoint_px;
      Add(line, keypoint_px.x() + kPixelCentre);
      Add(line, keypoint_px.y() + kPixelCentre);
      line += " " + std::to_string(keypoint.has_point ? ColmapPointId(track.id) : -1);
    }
    text += (line.empty() ? line : line.substr(1)) + "\n";
  }
  return text;
}

std::string TextPoints(const RunMap& map, const std::vector<std::vector<int>>& numbers) {
  std::string text = "# POINT3D_ID X Y Z R G B ERROR, then IMAGE_ID POINT2D_IDX of its track\n";
  for (std::size_t t = 0; t < map.tracks.size(); ++t) {
    const MapTrack& entry = map.tracks[t];
    if (!HasPoint(entry)) continue;
    text += std::to_string(ColmapPointId(entry.track.id));
    for (const double value : *entry.point_in_world) Add(text, value);
    for (const std::uint8_t value : entry.track.rgb) text += " " + std::to_string(value);
    Add(text, MeanErrorPx(map, entry));
    for (std::size_t k = 0; k < entry.fits.size(); ++k) {
      if (!entry.fits[k]) continue;
      text += " " + std::to_string(ColmapImageId(entry.track.observations[k].frame)) + " " +
              std::to_string(numbers[t][k]);
    }
    text += "\n";
  }
  return text;
}

}  // namespace

ColmapCamera ToColmap(const Camera& camera) {
  const auto& d = camera.distortion;
  ColmapCamera colmap;
  colmap.parameters = {camera.fx, camera.fy, camera.cx + kPixelCentre, camera.cy + kPixelCentre};
  const auto with = [&](int id, const char* model, const std::vector<double>& more) {
    colmap.model_id = id;
    colmap.model = model;
    colmap.parameters.insert(colmap.parameters.end(), more.begin(), more.end());
    return colmap;
  };
  switch (camera.model) {
    case CameraModel::kPinhole:
      return with(1, "PINHOLE", {});
    case CameraModel::kRadtan:
      if (d[4] == 0.0) return with(4, "OPENCV", {d[0], d[1], d[2], d[3]});
      return with(6, "FULL_OPENCV", {d[0], d[1], d[2], d[3], d[4], 0.0, 0.0, 0.0});
    case CameraModel::kEquidistant:
      return with(5, "OPENCV_FISHEYE", {d[0], d[1], d[2], d[3]});
    case CameraModel::kRational:
      return with(6, "FULL_OPENCV", {d[0], d[1], d[2], d[3], d[4], d[5], d[6], d[7]});
    case CameraModel::kFov:
      return with(7, "FOV", {d[0]});
  }
  throw std::invalid_argument("ToColmap: the camera's model is not known");
}

void WriteColmapModel(const fs::path& folder, const RunMap& map, ColmapForm form) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw std::runtime_error(folder.string() + ": cannot be made: " + error.message());
  const auto keypoints = ListKeypoints(map);
  const std::vector<std::vector<int>> numbers = NumberKeypoints(map);
  const bool is_text = form == ColmapForm::kText;
  for (const char* name : {"cameras", "images", "points3D"}) {
    fs::remove(folder / (std::string(name) + (is_text ? ".bin" : ".txt")), error);
  }
  if (is_text) {
    ReplaceFile(folder / "cameras.txt", TextCameras(map));
    ReplaceFile(folder / "images.txt", TextImages(map, keypoints));
    ReplaceFile(folder / "points3D.txt", TextPoints(map, numbers));
    return;
  }
  ReplaceFile(folder / "cameras.bin", BinaryCameras(map));
  ReplaceFile(folder / "images.bin", BinaryImages(map, keypoints));
  ReplaceFile(folder / "points3D.bin", BinaryPoints(map, numbers));
}

}  // namespace rotslam
