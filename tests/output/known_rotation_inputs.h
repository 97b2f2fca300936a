#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <string>

#include "tests/scenes/scene.h"

namespace rotslam {

inline std::string Number(double value) {
  char text[40];
  std::snprintf(text, sizeof(text), " %.17g", value);
  return text;
}

/// The scene as a COLMAP model in text, image and point ids one above ours; its orientations are
/// those a solver is given, its positions and points all zero.
inline void WriteColmapText(const std::filesystem::path& folder, const Scene& scene) {
  std::filesystem::create_directories(folder);
  const Camera& camera = scene.camera;
  std::ofstream(folder / "cameras.txt")
      << "# a comment\n1 PINHOLE " << camera.width << " " << camera.height << Number(camera.fx)
      << Number(camera.fy) << Number(camera.cx + 0.5) << Number(camera.cy + 0.5) << "\n";
  std::map<FrameId, std::string> keypoints;
  std::map<FrameId, int> count;
  std::ofstream points(folder / "points3D.txt");
  for (const Track& track : scene.tracks) {
    points << track.id.value + 1 << " 0 0 0 10 20 30 0.5";
    for (const Observation& observation : track.observations) {
      keypoints[observation.frame] += Number(observation.keypoint_px.x() + 0.5) +
                                      Number(observation.keypoint_px.y() + 0.5) + " " +
                                      std::to_string(track.id.value + 1);
      points << " " << observation.frame.value + 1 << " " << count[observation.frame]++;
    }
    points << "\n";
  }
  std::ofstream images(folder / "images.txt");
  for (const auto& [frame, cam_from_world] : scene.cam_from_world) {
    const Eigen::Quaterniond& q = cam_from_world.Quaternion();
    images << frame.value + 1 << Number(q.w()) << Number(q.x()) << Number(q.y()) << Number(q.z())
           << " 0 0 0 1 image" << frame.value << ".png\n"
           << keypoints[frame] << "\n";
  }
}

class BinaryFile {
 public:
  explicit BinaryFile(const std::filesystem::path& path) : stream_(path, std::ios::binary) {}
  template <class T>
  void Put(T value) {
    stream_.write(reinterpret_cast<const char*>(&value), sizeof(T));
  }
  void PutName(const std::string& name) { stream_.write(name.c_str(), name.size() + 1); }

 private:
  std::ofstream stream_;
};

/// The same in binary.
inline void WriteColmapBinary(const std::filesystem::path& folder, const Scene& scene) {
  std::filesystem::create_directories(folder);
  BinaryFile cameras(folder / "cameras.bin");
  cameras.Put(std::uint64_t{1});
  cameras.Put(std::uint32_t{1});
  cameras.Put(std::int32_t{1});
  cameras.Put(static_cast<std::uint64_t>(scene.camera.width));
  cameras.Put(static_cast<std::uint64_t>(scene.camera.height));
  for (const double value :
       {scene.camera.fx, scene.camera.fy, scene.camera.cx + 0.5, scene.camera.cy + 0.5}) {
    cameras.Put(value);
  }
  std::map<FrameId, std::vector<std::pair<Eigen::Vector2d, int>>> keypoints;
  BinaryFile points(folder / "points3D.bin");
  points.Put(static_cast<std::uint64_t>(scene.tracks.size()));
  for (const Track& track : scene.tracks) {
    points.Put(static_cast<std::uint64_t>(track.id.value + 1));
    for (int k = 0; k < 3; ++k) points.Put(0.0);
    for (const int value : {10, 20, 30}) points.Put(static_cast<std::uint8_t>(value));
    points.Put(0.5);
    points.Put(static_cast<std::uint64_t>(track.observations.size()));
    for (const Observation& observation : track.observations) {
      points.Put(static_cast<std::uint32_t>(observation.frame.value + 1));
      points.Put(static_cast<std::uint32_t>(keypoints[observation.frame].size()));
      keypoints[observation.frame].emplace_back(observation.keypoint_px, track.id.value + 1);
    }
  }
  BinaryFile images(folder / "images.bin");
  images.Put(static_cast<std::uint64_t>(scene.cam_from_world.size()));
  for (const auto& [frame, cam_from_world] : scene.cam_from_world) {
    const Eigen::Quaterniond& q = cam_from_world.Quaternion();
    images.Put(static_cast<std::uint32_t>(frame.value + 1));
    for (const double value : {q.w(), q.x(), q.y(), q.z(), 0.0, 0.0, 0.0}) images.Put(value);
    images.Put(std::uint32_t{1});
    images.PutName("image" + std::to_string(frame.value) + ".png");
    images.Put(static_cast<std::uint64_t>(keypoints[frame].size()));
    for (const auto& [keypoint_px, point] : keypoints[frame]) {
      images.Put(keypoint_px.x() + 0.5);
      images.Put(keypoint_px.y() + 0.5);
      images.Put(static_cast<std::uint64_t>(point));
    }
  }
}

/// The scene as a BAL problem, its positions and points all zero.
inline void WriteBal(const std::filesystem::path& path, const Scene& scene) {
  std::ofstream file(path);
  std::size_t num_observations = 0;
  int num_points = 0;
  for (const Track& track : scene.tracks) {
    num_observations += track.observations.size();
    num_points = std::max(num_points, track.id.value + 1);
  }
  file << scene.cam_from_world.size() << " " << num_points << " " << num_observations << "\n";
  for (const Track& track : scene.tracks) {
    for (const Observation& observation : track.observations) {
      file << observation.frame.value << " " << track.id.value
           << Number(observation.keypoint_px.x() - scene.camera.cx)
           << Number(scene.camera.cy - observation.keypoint_px.y()) << "\n";
    }
  }
  const Rotation half_turn = Rotation::Exp({std::numbers::pi, 0.0, 0.0});
  for (const auto& [frame, cam_from_world] : scene.cam_from_world) {
    const Eigen::Vector3d vector = (half_turn * cam_from_world).Log();
    for (int k = 0; k < 3; ++k) file << Number(vector[k]) << "\n";
    for (const double value : {0.0, 0.0, 0.0, scene.camera.fx, 0.0, 0.0}) file << value << "\n";
  }
  for (int k = 0; k < 3 * num_points; ++k) file << "0\n";
}

}  // namespace rotslam
