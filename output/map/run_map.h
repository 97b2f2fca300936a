#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "rotodom/camera/camera.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/reconstruction.h"
#include "rotodom/types/trajectory.h"

namespace rotslam {

/// An input frame and its pose.
struct MapFrame {
  FrameId id;
  double timestamp_s = 0.0;
  std::string image;  // file name below RunMap::image_folder
  bool is_keyframe = false;
  Rotation cam_from_world;
  Eigen::Vector3d center_in_world = Eigen::Vector3d::Zero();
};

/// A track, the point it shows where one was found, and which of its sightings that point explains.
struct MapTrack {
  Track track;
  std::optional<Eigen::Vector3d> point_in_world;
  std::vector<bool> fits;            // one per observation; all false without a point
  std::vector<std::uint8_t> levels;  // one per observation: pyramid level that shows it
};

/// An edge of the view-graph, as far as exports ask for it.
struct MapEdge {
  FrameId i;
  FrameId j;
  int num_inliers = 0;
  bool rotation_only = false;
};

/// The map of a run, from which other systems can start.
struct RunMap {
  Camera camera;  // refined; keypoints are pixels of its distorted image
  // Those of frames that have another one, whose keypoints are pixels of it (GiveFrameCameras);
  // files do not have them.
  std::map<FrameId, Camera> frame_cameras;
  std::string image_folder;  // of the images; for a video, the file
  bool is_video = false;
  // Of the pyramid that the levels belong to.
  double level_scale = 1.2;
  int num_levels = 8;
  std::vector<MapFrame> frames;  // all of them, ids ascend
  std::vector<MapTrack> tracks;  // ids ascend
  std::vector<MapEdge> edges;
};

/// Puts tracks and what was made of them together; levels are all 0.
/// @param tracks  all sightings.
/// @param solved  its tracks hold the sightings that fit, which replace those given of the same
///                track and
///                frame; only tracks with a point count.
std::vector<MapTrack> JoinTracks(const std::vector<Track>& tracks, const Reconstruction& solved);

/// The part of a map that has only `frames`: the other frames are left out, and their sightings,
/// tracks without any sighting left, and edges at them.
RunMap PartOf(const RunMap& map, const std::set<FrameId>& frames);

/// The keyframes of a map.
std::set<FrameId> KeyframesOf(const RunMap& map);

/// Points, and the sightings that fit, of the frames in the map.
Reconstruction ToReconstruction(const RunMap& map);

/// Camera->world poses of its frames.
Trajectory ToTrajectory(const RunMap& map);

/// Writes a map in a binary form of our own: all numbers to the last bit, but for the keypoints,
/// their bearings (found again from the keypoints) and sigmas, which are single precision.
/// Throws std::runtime_error when the file cannot be written.
void WriteRunMap(const std::filesystem::path& path, const RunMap& map);

/// Reads what WriteRunMap has written, that of version 0.1.0, too. Throws std::runtime_error with
/// path and reason in one line: not such a file, cut short, counts beyond its size, ids that do not
/// ascend or name nothing, numbers that are not finite.
RunMap ReadRunMap(const std::filesystem::path& path);

}  // namespace rotslam
