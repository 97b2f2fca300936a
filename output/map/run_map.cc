#include "output/map/run_map.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>

#include "output/files/atomic_file.h"
#include "output/files/binary_file.h"

namespace rotslam {
namespace {

constexpr std::string_view kMagic = "rotslam_map 3\n";
// As version 0.1.0 wrote it: a camera has five coefficients of its distortion instead of eight.
constexpr std::string_view kMagicOfFive = "rotslam_map 2\n";
static_assert(kMagic.size() == kMagicOfFive.size());
constexpr double kMaxOwnNormError = 1e-6;

void PutRotation(BinaryWriter& writer, const Rotation& rotation) {
  for (const double value : rotation.Quaternion().coeffs()) writer.Put(value);
}

Rotation GetRotation(BinaryReader& reader) {
  Eigen::Vector4d coefficients;
  for (double& value : coefficients) value = reader.Get<double>();
  const Eigen::Quaterniond q(coefficients);
  if (!(std::abs(q.norm() - 1.0) < kMaxOwnNormError)) {
    reader.Fail("a quaternion is not of length 1");
  }
  return Rotation(q);
}

Eigen::Vector3d GetPosition(BinaryReader& reader, const char* what) {
  Eigen::Vector3d position;
  for (double& value : position) value = reader.Get<double>();
  if (!position.allFinite()) reader.Fail(std::string(what) + " is not finite");
  return position;
}

// An id of a frame or track. Other formats count from 1: the largest one must have a successor.
int GetId(BinaryReader& reader, const char* what) {
  const auto id = reader.Get<std::int32_t>();
  if (id < 0 || id == std::numeric_limits<std::int32_t>::max()) {
    reader.Fail(std::string(what) + " has the number " + std::to_string(id) +
                ", not one from 0 on");
  }
  return id;
}

void PutCamera(BinaryWriter& writer, const Camera& camera) {
  writer.Put(static_cast<std::int32_t>(camera.model));
  writer.Put(static_cast<std::int32_t>(camera.width));
  writer.Put(static_cast<std::int32_t>(camera.height));
  for (const double value : {camera.fx, camera.fy, camera.cx, camera.cy}) writer.Put(value);
  for (const double value : camera.distortion) writer.Put(value);
  writer.Put(camera.readout_s);
  writer.Put(static_cast<std::int32_t>(camera.readout_from));
}

Camera GetCamera(BinaryReader& reader, std::size_t num_coefficients) {
  Camera camera;
  const auto model = reader.Get<std::int32_t>();
  if (model < 0 || model >= std::ssize(AllCameraModels())) {
    reader.Fail("camera model " + std::to_string(model) + " is not known");
  }
  camera.model = static_cast<CameraModel>(model);
  camera.width = reader.Get<std::int32_t>();
  camera.height = reader.Get<std::int32_t>();
  for (double* value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) {
    *value = reader.Get<double>();
  }
  for (std::size_t k = 0; k < num_coefficients; ++k) camera.distortion[k] = reader.Get<double>();
  camera.readout_s = reader.Get<double>();
  const auto readout_from = reader.Get<std::int32_t>();
  if (readout_from < 0 || readout_from > static_cast<std::int32_t>(ReadoutStart::kRight)) {
    reader.Fail("the shutter's start " + std::to_string(readout_from) + " is not known");
  }
  camera.readout_from = static_cast<ReadoutStart>(readout_from);
  if (const auto problem = camera.Problem()) reader.Fail("camera: " + *problem);
  return camera;
}

void PutTrack(BinaryWriter& writer, const MapTrack& entry) {
  writer.Put(static_cast<std::int32_t>(entry.track.id.value));
  for (const std::uint8_t value : entry.track.rgb) writer.Put(value);
  writer.Put(static_cast<std::uint8_t>(entry.point_in_world.has_value()));
  if (entry.point_in_world) {
    for (const double value : *entry.point_in_world) writer.Put(value);
  }
  writer.Put(static_cast<std::uint64_t>(entry.track.observations.size()));
  for (std::size_t k = 0; k < entry.track.observations.size(); ++k) {
    const Observation& observation = entry.track.observations[k];
    writer.Put(static_cast<std::int32_t>(observation.frame.value));
    writer.Put(static_cast<float>(observation.keypoint_px.x()));
    writer.Put(static_cast<float>(observation.keypoint_px.y()));
    writer.Put(static_cast<float>(observation.sigma_px));
    writer.Put(static_cast<std::uint8_t>(entry.fits[k]));
    writer.Put(entry.levels[k]);
  }
}

MapTrack GetTrack(BinaryReader& reader,
                  const Camera& camera,
                  int num_levels,
                  const std::set<FrameId>& frames) {
  MapTrack entry;
  Track& track = entry.track;
  track.id = TrackId{GetId(reader, "a track")};
  const std::string who = "track " + std::to_string(track.id.value);
  for (std::uint8_t& value : track.rgb) value = reader.Get<std::uint8_t>();
  if (reader.Get<std::uint8_t>() != 0) entry.point_in_world = GetPosition(reader, "a point");
  const auto count = reader.Count("observations", 18);
  track.observations.reserve(count);
  entry.fits.reserve(count);
  entry.levels.reserve(count);
  for (std::uint64_t k = 0; k < count; ++k) {
    Observation observation;
    observation.frame = FrameId{GetId(reader, "a frame")};
    observation.keypoint_px.x() = reader.Get<float>();
    observation.keypoint_px.y() = reader.Get<float>();
    observation.sigma_px = reader.Get<float>();
    const bool fits = reader.Get<std::uint8_t>() != 0;
    const auto level = reader.Get<std::uint8_t>();
    if (level >= num_levels) reader.Fail(who + ": a level is beyond the pyramid");
    if (!observation.keypoint_px.allFinite()) reader.Fail(who + ": a keypoint is not finite");
    if (!(observation.sigma_px > 0.0)) reader.Fail(who + ": a sigma is not positive");
    if (!frames.contains(observation.frame)) {
      reader.Fail(who + " names frame " + std::to_string(observation.frame.value) +
                  ", which there is not");
    }
    if (!track.observations.empty() && observation.frame <= track.observations.back().frame) {
      reader.Fail(who + ": its frames do not ascend");
    }
    const auto bearing = camera.Unproject(observation.keypoint_px);
    if (!bearing) continue;
    observation.bearing = *bearing;
    track.observations.push_back(observation);
    entry.fits.push_back(fits);
    entry.levels.push_back(level);
  }
  return entry;
}

MapTrack WithoutPoint(const Track& track) {
  return {track,
          std::nullopt,
          std::vector<bool>(track.observations.size(), false),
          std::vector<std::uint8_t>(track.observations.size(), 0)};
}

// @param fitting  a track with its sightings that fit.
// @param given    of the same track; those in frames that fit are not taken.
MapTrack WithPoint(Track fitting,
                   const Eigen::Vector3d& point_in_world,
                   const std::vector<Observation>& given) {
  MapTrack entry;
  entry.point_in_world = point_in_world;
  if (given.empty()) {
    entry.fits.assign(fitting.observations.size(), true);
    entry.track = std::move(fitting);
  } else {
    entry.track.id = fitting.id;
    entry.track.rgb = fitting.rgb;
    const auto add = [&](const Observation& observation, bool fits) {
      entry.track.observations.push_back(observation);
      entry.fits.push_back(fits);
    };
    auto next = given.begin();
    for (const Observation& observation : fitting.observations) {
      for (; next != given.end() && next->frame < observation.frame; ++next) add(*next, false);
      if (next != given.end() && next->frame == observation.frame) ++next;
      add(observation, true);
    }
    for (; next != given.end(); ++next) add(*next, false);
  }
  entry.levels.resize(entry.fits.size(), 0);
  return entry;
}

}  // namespace

std::vector<MapTrack> JoinTracks(const std::vector<Track>& tracks, const Reconstruction& solved) {
  std::map<TrackId, MapTrack> joined;
  for (const Track& track : tracks) {
    joined[track.id] = WithoutPoint(track);
  }
  for (const Track& track : solved.tracks) {
    const auto point = solved.point_in_world.find(track.id);
    if (point == solved.point_in_world.end()) continue;
    MapTrack& entry = joined[track.id];
    entry = WithPoint(track, point->second, entry.track.observations);
  }
  std::vector<MapTrack> list;
  list.reserve(joined.size());
  for (auto& [id, entry] : joined) list.push_back(std::move(entry));
  return list;
}

RunMap PartOf(const RunMap& map, const std::set<FrameId>& frames) {
  RunMap part;
  part.camera = map.camera;
  part.frame_cameras = map.frame_cameras;
  part.image_folder = map.image_folder;
  part.is_video = map.is_video;
  part.level_scale = map.level_scale;
  part.num_levels = map.num_levels;
  for (const MapFrame& frame : map.frames) {
    if (frames.contains(frame.id)) part.frames.push_back(frame);
  }
  for (const MapTrack& entry : map.tracks) {
    MapTrack shorter;
    shorter.track.id = entry.track.id;
    shorter.track.rgb = entry.track.rgb;
    shorter.point_in_world = entry.point_in_world;
    for (std::size_t k = 0; k < entry.fits.size(); ++k) {
      if (!frames.contains(entry.track.observations[k].frame)) continue;
      shorter.track.observations.push_back(entry.track.observations[k]);
      shorter.fits.push_back(entry.fits[k]);
      shorter.levels.push_back(entry.levels[k]);
    }
    if (!shorter.fits.empty()) part.tracks.push_back(std::move(shorter));
  }
  for (const MapEdge& edge : map.edges) {
    if (frames.contains(edge.i) && frames.contains(edge.j)) part.edges.push_back(edge);
  }
  return part;
}

std::set<FrameId> KeyframesOf(const RunMap& map) {
  std::set<FrameId> keyframes;
  for (const MapFrame& frame : map.frames) {
    if (frame.is_keyframe) keyframes.insert(frame.id);
  }
  return keyframes;
}

Reconstruction ToReconstruction(const RunMap& map) {
  Reconstruction reconstruction;
  for (const MapFrame& frame : map.frames) {
    reconstruction.cam_from_world[frame.id] = frame.cam_from_world;
    reconstruction.center_in_world[frame.id] = frame.center_in_world;
  }
  for (const MapTrack& entry : map.tracks) {
    if (!entry.point_in_world) continue;
    Track track{entry.track.id, {}, entry.track.rgb};
    for (std::size_t k = 0; k < entry.fits.size(); ++k) {
      if (entry.fits[k]) track.observations.push_back(entry.track.observations[k]);
    }
    reconstruction.point_in_world[track.id] = *entry.point_in_world;
    reconstruction.tracks.push_back(std::move(track));
  }
  return reconstruction;
}

Trajectory ToTrajectory(const RunMap& map) {
  Trajectory trajectory;
  trajectory.reserve(map.frames.size());
  for (const MapFrame& frame : map.frames) {
    trajectory.push_back(
        {frame.timestamp_s, frame.cam_from_world.Inverse(), frame.center_in_world});
  }
  return trajectory;
}

void WriteRunMap(const std::filesystem::path& path, const RunMap& map) {
  BinaryWriter writer;
  for (const char c : kMagic) writer.Put(c);
  PutCamera(writer, map.camera);
  writer.PutName(map.image_folder);
  writer.Put(static_cast<std::uint8_t>(map.is_video));
  writer.Put(map.level_scale);
  writer.Put(static_cast<std::int32_t>(map.num_levels));
  writer.Put(static_cast<std::uint64_t>(map.frames.size()));
  for (const MapFrame& frame : map.frames) {
    writer.Put(static_cast<std::int32_t>(frame.id.value));
    writer.Put(frame.timestamp_s);
    writer.PutName(frame.image);
    writer.Put(static_cast<std::uint8_t>(frame.is_keyframe));
    PutRotation(writer, frame.cam_from_world);
    for (const double value : frame.center_in_world) writer.Put(value);
  }
  writer.Put(static_cast<std::uint64_t>(map.tracks.size()));
  for (const MapTrack& track : map.tracks) PutTrack(writer, track);
  writer.Put(static_cast<std::uint64_t>(map.edges.size()));
  for (const MapEdge& edge : map.edges) {
    writer.Put(static_cast<std::int32_t>(edge.i.value));
    writer.Put(static_cast<std::int32_t>(edge.j.value));
    writer.Put(static_cast<std::int32_t>(edge.num_inliers));
    writer.Put(static_cast<std::uint8_t>(edge.rotation_only));
  }
  ReplaceFile(path, writer.bytes());
}

RunMap ReadRunMap(const std::filesystem::path& path) {
  BinaryReader reader(path);
  const auto magic = reader.Take(kMagic.size());
  if (magic != kMagic && magic != kMagicOfFive) {
    reader.Fail("is not a map that this version of `rotslam run` writes");
  }
  RunMap map;
  map.camera = GetCamera(reader, magic == kMagic ? map.camera.distortion.size() : 5);
  map.image_folder = reader.Name();
  map.is_video = reader.Get<std::uint8_t>() != 0;
  map.level_scale = reader.Get<double>();
  map.num_levels = reader.Get<std::int32_t>();
  if (!(map.level_scale > 1.0 && map.level_scale < 10.0) || map.num_levels < 1 ||
      map.num_levels > 255) {
    reader.Fail("its pyramid makes no sense");
  }
  std::set<FrameId> frames;
  const auto num_frames = reader.Count("frames", 70);
  map.frames.reserve(num_frames);
  for (auto left = num_frames; left > 0; --left) {
    MapFrame& frame = map.frames.emplace_back();
    frame.id = FrameId{GetId(reader, "a frame")};
    if (!frames.empty() && frame.id <= *frames.rbegin()) reader.Fail("its frames do not ascend");
    frames.insert(frame.id);
    frame.timestamp_s = reader.Get<double>();
    if (!std::isfinite(frame.timestamp_s)) reader.Fail("a timestamp is not finite");
    frame.image = reader.Name();
    frame.is_keyframe = reader.Get<std::uint8_t>() != 0;
    frame.cam_from_world = GetRotation(reader);
    frame.center_in_world = GetPosition(reader, "the place of a frame");
  }
  const auto num_tracks = reader.Count("tracks", 16);
  map.tracks.reserve(num_tracks);
  for (auto left = num_tracks; left > 0; --left) {
    MapTrack track = GetTrack(reader, map.camera, map.num_levels, frames);
    if (!map.tracks.empty() && track.track.id <= map.tracks.back().track.id) {
      reader.Fail("its tracks do not ascend");
    }
    map.tracks.push_back(std::move(track));
  }
  const auto num_edges = reader.Count("edges", 13);
  map.edges.reserve(num_edges);
  for (auto left = num_edges; left > 0; --left) {
    MapEdge& edge = map.edges.emplace_back();
    edge.i = FrameId{reader.Get<std::int32_t>()};
    edge.j = FrameId{reader.Get<std::int32_t>()};
    edge.num_inliers = reader.Get<std::int32_t>();
    edge.rotation_only = reader.Get<std::uint8_t>() != 0;
    if (!frames.contains(edge.i) || !frames.contains(edge.j)) {
      reader.Fail("an edge names a frame that there is not");
    }
  }
  reader.ExpectEnd();
  return map;
}

}  // namespace rotslam
