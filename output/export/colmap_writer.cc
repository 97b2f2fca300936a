#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "output/export/colmap_model.h"
#include "output/files/atomic_file.h"
#include "output/files/binary_file.h"
#include "output/map/frame_cameras.h"
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
  const std::vector<Camera> cameras = ListCameras(map).cameras;
  BinaryWriter writer;
  writer.Put(static_cast<std::uint64_t>(cameras.size()));
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    const ColmapCamera camera = ToColmap(cameras[k]);
    writer.Put(static_cast<std::uint32_t>(kColmapCameraId + k));
    writer.Put(static_cast<std::int32_t>(camera.model_id));
    writer.Put(static_cast<std::uint64_t>(cameras[k].width));
    writer.Put(static_cast<std::uint64_t>(cameras[k].height));
    for (const double value : camera.parameters) writer.Put(value);
  }
  return writer.bytes();
}

std::string BinaryImages(const RunMap& map,
                         const std::map<FrameId, std::vector<MapKeypoint>>& keypoints) {
  const CameraList cameras = ListCameras(map);
  BinaryWriter writer;
  writer.Put(static_cast<std::uint64_t>(map.frames.size()));
  for (const MapFrame& frame : map.frames) {
    writer.Put(static_cast<std::uint32_t>(ColmapImageId(frame.id)));
    for (const double value : PoseNumbers(frame)) writer.Put(value);
    writer.Put(static_cast<std::uint32_t>(kColmapCameraId + cameras.of_frame.at(frame.id)));
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
  const std::vector<Camera> cameras = ListCameras(map).cameras;
  std::string text = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS\n";
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    const ColmapCamera camera = ToColmap(cameras[k]);
    text += std::to_string(kColmapCameraId + k) + " " + camera.model + " " +
            std::to_string(cameras[k].width) + " " + std::to_string(cameras[k].height);
    for (const double value : camera.parameters) Add(text, value);
    text += "\n";
  }
  return text;
}

std::string TextImages(const RunMap& map,
                       const std::map<FrameId, std::vector<MapKeypoint>>& keypoints) {
  const CameraList cameras = ListCameras(map);
  std::string text =
      "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then X Y POINT3D_ID of its keypoints\n";
  for (const MapFrame& frame : map.frames) {
    text += std::to_string(ColmapImageId(frame.id));
    for (const double value : PoseNumbers(frame)) Add(text, value);
    text += " " + std::to_string(kColmapCameraId + cameras.of_frame.at(frame.id)) + " " +
            frame.image + "\n";
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

namespace {

// A solved model in the ids of the file that it comes from.
struct SolvedModel {
  const ColmapModel& model;
  const Reconstruction& solved;
  // By image and place of the keypoint, the id of the point that it shows.
  std::map<FrameId, std::map<int, std::uint64_t>> point_of;
};

// Calls `take(observation, keypoint)` for those of a solved track.
template <class Take>
void ForEachSight(const ColmapModel& model, const Track& track, Take&& take) {
  const Track& given = model.reconstruction.tracks.at(track.id.value);
  const std::vector<int>& keypoints = model.keypoints.at(track.id);
  std::size_t k = 0;
  for (const Observation& observation : track.observations) {
    while (given.observations[k].frame != observation.frame) ++k;
    take(observation, keypoints[k]);
  }
}

SolvedModel MakeSolved(const ColmapModel& model, const Reconstruction& solved) {
  SolvedModel made{model, solved, {}};
  for (const Track& track : solved.tracks) {
    if (!solved.point_in_world.contains(track.id)) continue;
    ForEachSight(model, track, [&](const Observation& observation, int keypoint) {
      made.point_of[observation.frame][keypoint] = model.point_id.at(track.id);
    });
  }
  return made;
}

// How far a keypoint is from where its camera sees the point, px.
std::optional<double> SightErrorPx(const ColmapModel& model,
                                   const Reconstruction& map,
                                   const Eigen::Vector3d& point,
                                   FrameId frame,
                                   int keypoint) {
  const ColmapImage& image = model.images.at(frame);
  const Eigen::Vector3d in_cam =
      map.cam_from_world.at(frame) * (point - map.center_in_world.at(frame));
  const auto seen = model.cameras.at(image.camera).Project(in_cam);
  if (!seen) return std::nullopt;
  return (*seen + Eigen::Vector2d::Constant(kPixelCentre) -
          image.keypoints_px[static_cast<std::size_t>(keypoint)])
      .norm();
}

// The mean over a track's observations that their cameras can see; nullopt where there are none.
std::optional<double> PointErrorPx(const ColmapModel& model,
                                   const Reconstruction& map,
                                   const Track& track) {
  const Eigen::Vector3d& point = map.point_in_world.at(track.id);
  double sum_px = 0.0;
  int count = 0;
  ForEachSight(model, track, [&](const Observation& observation, int keypoint) {
    const auto error_px = SightErrorPx(model, map, point, observation.frame, keypoint);
    if (!error_px) return;
    sum_px += *error_px;
    ++count;
  });
  return count == 0 ? std::nullopt : std::optional(sum_px / count);
}

// One form of the three files: numbers and names one after the other, lines where there are such.
class ModelText {
 public:
  explicit ModelText(ColmapForm form) : is_text_(form == ColmapForm::kText) {}

  void Count(std::uint64_t count) {
    if (!is_text_) writer_.Put(count);
  }
  template <class Binary>
  void Whole(std::uint64_t value) {
    if (is_text_) {
      Word(std::to_string(value));
    } else {
      writer_.Put(static_cast<Binary>(value));
    }
  }
  void Number(double value) {
    if (is_text_) {
      Word(FormatNumber("%.17g", value));
    } else {
      writer_.Put(value);
    }
  }
  void Name(const std::string& name) {
    if (is_text_) {
      Word(name);
    } else {
      writer_.PutName(name);
    }
  }
  // The word that stands in text for what has a number in binary.
  void Model(const ColmapCamera& camera) {
    if (is_text_) {
      Word(camera.model);
    } else {
      writer_.Put(static_cast<std::int32_t>(camera.model_id));
    }
  }
  void NoPoint() {
    if (is_text_) {
      Word("-1");
    } else {
      writer_.Put(std::numeric_limits<std::uint64_t>::max());
    }
  }
  void EndLine() {
    if (is_text_) text_ += '\n';
    at_start_ = true;
  }
  const std::string& content() const { return is_text_ ? text_ : writer_.bytes(); }

 private:
  void Word(const std::string& word) {
    if (!at_start_) text_ += ' ';
    text_ += word;
    at_start_ = false;
  }

  bool is_text_;
  bool at_start_ = true;
  std::string text_;
  BinaryWriter writer_;
};

std::string SolvedCameras(const ColmapModel& model, ColmapForm form) {
  ModelText text(form);
  text.Count(model.cameras.size());
  for (const auto& [id, camera] : model.cameras) {
    const ColmapCamera colmap = ToColmap(camera);
    text.Whole<std::uint32_t>(static_cast<std::uint64_t>(id));
    text.Model(colmap);
    text.Whole<std::uint64_t>(static_cast<std::uint64_t>(camera.width));
    text.Whole<std::uint64_t>(static_cast<std::uint64_t>(camera.height));
    for (const double value : colmap.parameters) text.Number(value);
    text.EndLine();
  }
  return text.content();
}

std::string SolvedImages(const SolvedModel& made, ColmapForm form) {
  ModelText text(form);
  text.Count(made.solved.center_in_world.size());
  for (const auto& [frame, center] : made.solved.center_in_world) {
    const ColmapImage& image = made.model.images.at(frame);
    text.Whole<std::uint32_t>(static_cast<std::uint64_t>(frame.value));
    MapFrame pose;
    pose.cam_from_world = made.solved.cam_from_world.at(frame);
    pose.center_in_world = center;
    for (const double value : PoseNumbers(pose)) text.Number(value);
    text.Whole<std::uint32_t>(static_cast<std::uint64_t>(image.camera));
    text.Name(made.model.image_name.at(frame));
    text.EndLine();
    text.Count(image.keypoints_px.size());
    const auto points = made.point_of.find(frame);
    for (std::size_t k = 0; k < image.keypoints_px.size(); ++k) {
      text.Number(image.keypoints_px[k].x());
      text.Number(image.keypoints_px[k].y());
      if (points == made.point_of.end() || !points->second.contains(static_cast<int>(k))) {
        text.NoPoint();
      } else {
        text.Whole<std::uint64_t>(points->second.at(static_cast<int>(k)));
      }
    }
    text.EndLine();
  }
  return text.content();
}

std::string SolvedPoints(const SolvedModel& made, ColmapForm form) {
  ModelText text(form);
  text.Count(made.solved.point_in_world.size());
  for (const Track& track : made.solved.tracks) {
    const auto point = made.solved.point_in_world.find(track.id);
    if (point == made.solved.point_in_world.end()) continue;
    text.Whole<std::uint64_t>(made.model.point_id.at(track.id));
    for (const double value : point->second) text.Number(value);
    for (const std::uint8_t value : track.rgb) text.Whole<std::uint8_t>(value);
    text.Number(PointErrorPx(made.model, made.solved, track).value_or(0.0));
    text.Count(track.observations.size());
    ForEachSight(made.model, track, [&](const Observation& observation, int keypoint) {
      text.Whole<std::uint32_t>(static_cast<std::uint64_t>(observation.frame.value));
      text.Whole<std::uint32_t>(static_cast<std::uint64_t>(keypoint));
    });
    text.EndLine();
  }
  return text.content();
}

}  // namespace

ColmapFigures FiguresOf(const ColmapModel& model, const Reconstruction& map) {
  ColmapFigures figures;
  figures.num_images = static_cast<int>(map.center_in_world.size());
  double sum_px = 0.0;
  for (const Track& track : map.tracks) {
    if (!map.point_in_world.contains(track.id)) continue;
    ++figures.num_points;
    figures.num_observations += static_cast<int>(track.observations.size());
    const auto error_px = PointErrorPx(model, map, track);
    if (!error_px) continue;
    sum_px += *error_px;
    ++figures.num_seen;
  }
  if (figures.num_seen > 0) figures.mean_error_px = sum_px / figures.num_seen;
  return figures;
}

void WriteColmapModel(const fs::path& folder,
                      const ColmapModel& model,
                      const Reconstruction& solved,
                      ColmapForm form) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw std::runtime_error(folder.string() + ": cannot be made: " + error.message());
  const SolvedModel made = MakeSolved(model, solved);
  const bool is_text = form == ColmapForm::kText;
  const std::string ending = is_text ? ".txt" : ".bin";
  for (const char* name : {"cameras", "images", "points3D"}) {
    fs::remove(folder / (std::string(name) + (is_text ? ".bin" : ".txt")), error);
  }
  ReplaceFile(folder / ("cameras" + ending), SolvedCameras(model, form));
  ReplaceFile(folder / ("images" + ending), SolvedImages(made, form));
  ReplaceFile(folder / ("points3D" + ending), SolvedPoints(made, form));
}

}  // namespace rotslam
