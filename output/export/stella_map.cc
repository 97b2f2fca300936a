#include "output/export/stella_map.h"

#include <algorithm>
#include <cstring>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>

#include <Eigen/Dense>
#include <nlohmann/json.hpp>

#include "output/export/distortion_json.h"
#include "output/files/atomic_file.h"
#include "output/map/map_keypoints.h"

namespace rotslam {
namespace {

using Json = nlohmann::json;

constexpr const char* kCameraName = "rotslam";
constexpr const char* kOrbName = "rotslam ORB";
// What stella_vslam's extractor would search corners with; a map that is read has them already.
constexpr unsigned kFastThreshold = 20;
constexpr unsigned kMinFastThreshold = 7;

double FramesPerSecond(const RunMap& map) {
  if (map.frames.size() < 2) return 30.0;
  const double span_s = map.frames.back().timestamp_s - map.frames.front().timestamp_s;
  const int steps = map.frames.back().id.value - map.frames.front().id.value;
  return span_s > 0.0 ? steps / span_s : 30.0;
}

Json CameraToJson(const RunMap& map) {
  const Camera& camera = map.camera;
  const bool is_fisheye = camera.model == CameraModel::kEquidistant;
  Json json = {{"model_type", is_fisheye ? "Fisheye" : "Perspective"},
               {"setup_type", "Monocular"},
               {"color_order", "Gray"},
               {"cols", camera.width},
               {"rows", camera.height},
               {"fps", FramesPerSecond(map)},
               {"focal_x_baseline", 0.0},
               {"num_grid_cols", 64},
               {"num_grid_rows", 48},
               {"fx", camera.fx},
               {"fy", camera.fy},
               {"cx", camera.cx},
               {"cy", camera.cy}};
  AddDistortion(camera, json);
  return json;
}

// Where a camera without distortion would show it; nullopt behind its image plane.
std::optional<Eigen::Vector2d> Undistorted(const Camera& camera, const Eigen::Vector3d& bearing) {
  constexpr double kLeastDepth = 1e-3;
  if (bearing.z() < kLeastDepth) return std::nullopt;
  return Eigen::Vector2d(camera.fx * bearing.x() / bearing.z() + camera.cx,
                         camera.fy * bearing.y() / bearing.z() + camera.cy);
}

Json DescriptorToJson(const std::array<std::uint8_t, 32>& descriptor) {
  Json words = Json::array();
  for (std::size_t at = 0; at < descriptor.size(); at += sizeof(std::uint32_t)) {
    std::uint32_t word = 0;
    std::memcpy(&word, descriptor.data() + at, sizeof(word));
    words.push_back(word);
  }
  return words;
}

Json MakeKeyframe(const RunMap& map,
                  const MapFrame& frame,
                  const std::vector<MapKeypoint>& keypoints,
                  const KeypointDescriptors& descriptors) {
  Json corners = Json::array();
  Json words = Json::array();
  Json landmark_ids = Json::array();
  for (std::size_t k = 0; k < keypoints.size(); ++k) {
    const MapTrack& entry = map.tracks[keypoints[k].track];
    const Observation& seen = entry.track.observations[keypoints[k].observation];
    const auto pixel = Undistorted(map.camera, seen.bearing);
    if (!pixel) continue;
    corners.push_back({{"pt", {static_cast<float>(pixel->x()), static_cast<float>(pixel->y())}},
                       {"ang", static_cast<float>(descriptors.angles_deg[k])},
                       {"oct", unsigned{entry.levels[keypoints[k].observation]}}});
    words.push_back(DescriptorToJson(descriptors.descriptors[k]));
    landmark_ids.push_back(keypoints[k].has_point ? entry.track.id.value : -1);
  }
  const Eigen::Quaterniond& q = frame.cam_from_world.Quaternion();
  const Eigen::Vector3d t = -(frame.cam_from_world * frame.center_in_world);
  return {{"ts", frame.timestamp_s},
          {"src_frm_id", frame.id.value},  // which versions before 0.4 ask for
          {"cam", kCameraName},
          {"orb_params", kOrbName},
          {"rot_cw", {q.x(), q.y(), q.z(), q.w()}},
          {"trans_cw", {t.x(), t.y(), t.z()}},
          {"n_keypts", corners.size()},
          {"undist_keypts", std::move(corners)},
          {"x_rights", Json::array()},
          {"depths", Json::array()},
          {"descs", std::move(words)},
          {"lm_ids", std::move(landmark_ids)},
          {"span_parent", -1},
          {"span_children", Json::array()},
          {"loop_edges", Json::array()}};
}

// The landmarks (tracks) of every keyframe.
std::vector<std::set<int>> LandmarksShown(const std::vector<Json>& keyframes) {
  std::vector<std::set<int>> shown;
  shown.reserve(keyframes.size());
  for (const Json& keyframe : keyframes) {
    const std::vector<int> ids = keyframe["lm_ids"];
    shown.emplace_back(ids.begin(), ids.end()).erase(-1);
  }
  return shown;
}

// Every keyframe but the first hangs on an earlier one: that with the most common landmarks, the
// nearest of those; where there are none, the one before it.
void AddSpanningTree(const std::vector<std::set<int>>& shown, std::vector<Json>& keyframes) {
  for (std::size_t k = 1; k < keyframes.size(); ++k) {
    std::size_t parent = k - 1;
    std::ptrdiff_t most = 0;
    for (std::size_t earlier = k; earlier-- > 0;) {
      const std::set<int>& theirs = shown[earlier];
      const std::ptrdiff_t common =
          std::count_if(shown[k].begin(), shown[k].end(), [&](int landmark) {
            return theirs.contains(landmark);
          });
      if (common > most) {
        most = common;
        parent = earlier;
      }
    }
    keyframes[k]["span_parent"] = parent;
    keyframes[parent]["span_children"].push_back(k);
  }
}

// By id, of those that two keyframes or more show.
Json LandmarksToJson(const RunMap& map, const std::vector<std::set<int>>& shown) {
  std::map<int, std::vector<int>> shown_by;
  for (std::size_t k = 0; k < shown.size(); ++k) {
    for (const int landmark : shown[k]) shown_by[landmark].push_back(static_cast<int>(k));
  }
  Json landmarks = Json::object();
  for (const MapTrack& entry : map.tracks) {
    const auto found = shown_by.find(entry.track.id.value);
    if (found == shown_by.end()) continue;
    const std::vector<int>& by = found->second;
    const Eigen::Vector3d& point = *entry.point_in_world;
    landmarks[std::to_string(entry.track.id.value)] = {{"1st_keyfrm", by.front()},
                                                       {"pos_w", {point.x(), point.y(), point.z()}},
                                                       {"ref_keyfrm", by.front()},
                                                       {"n_vis", by.size()},
                                                       {"n_fnd", by.size()}};
  }
  return landmarks;
}

}  // namespace

void WriteStellaMap(const std::filesystem::path& path,
                    const RunMap& map,
                    const std::map<FrameId, KeypointDescriptors>& descriptors) {
  RefuseLensBeyondRadtan(path, map.camera, "stella_vslam");
  const auto keypoints = ListKeypoints(map);
  std::vector<Json> keyframes;
  keyframes.reserve(map.frames.size());
  for (const MapFrame& frame : map.frames) {
    const std::vector<MapKeypoint>& list = keypoints.at(frame.id);
    const auto found = descriptors.find(frame.id);
    if (found == descriptors.end() || found->second.descriptors.size() != list.size() ||
        found->second.angles_deg.size() != list.size()) {
      throw std::invalid_argument("WriteStellaMap: frame " + std::to_string(frame.id.value) +
                                  " has not a descriptor for each of its keypoints");
    }
    keyframes.push_back(MakeKeyframe(map, frame, list, found->second));
  }
  const std::vector<std::set<int>> shown = LandmarksShown(keyframes);
  AddSpanningTree(shown, keyframes);
  Json json = {{"cameras", {{kCameraName, CameraToJson(map)}}},
               {"orb_params",
                {{kOrbName,
                  {{"name", kOrbName},
                   {"scale_factor", static_cast<float>(map.level_scale)},
                   {"num_levels", map.num_levels},
                   {"ini_fast_threshold", kFastThreshold},
                   {"min_fast_threshold", kMinFastThreshold}}}}},
               {"landmarks", LandmarksToJson(map, shown)},
               {"keyframe_next_id", keyframes.size()},
               {"landmark_next_id", map.tracks.empty() ? 0 : map.tracks.back().track.id.value + 1}};
  json["keyframes"] = Json::object();
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    json["keyframes"][std::to_string(k)] = std::move(keyframes[k]);
  }
  const std::vector<std::uint8_t> bytes = Json::to_msgpack(json);
  ReplaceFile(path, std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

}  // namespace rotslam
