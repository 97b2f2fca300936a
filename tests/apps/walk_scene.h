#pragma once

#include <map>
#include <optional>
#include <random>
#include <vector>

#include "rotodom/features/features.h"
#include "rotodom/types/reconstruction.h"
#include "rotodom/types/similarity.h"
#include "tests/ba/ba_scene.h"

namespace rotslam {

inline constexpr int kNumFrames = 14;
inline constexpr int kFirstLate =
    10;  // the frames from there on do not know the points of those before
inline constexpr int kNumPoints = 400;

inline bool IsLate(FrameId frame) { return frame.value >= kFirstLate; }

// A walk past a rough wall, seen by `kNumFrames` frames, whose last ones have tracks of their own.
struct Walk {
  Walk() {
    for (int k = 0; k < kNumFrames; ++k) {
      const FrameId frame{k};
      truth.cam_from_world[frame] = Rotation::Exp({0.01 * k, 0.1 - 0.02 * k, 0.015 * k});
      truth.center_in_world[frame] = {0.2 * k - 1.0, 0.05 * k, 0.1 * k};
    }
    std::mt19937 random(5);
    const auto uniform = [&](double low, double high) {
      return low + (high - low) * (static_cast<double>(random()) / 4294967296.0);
    };
    cv::Mat descriptors(kNumPoints, 32, CV_8U);
    for (int k = 0; k < kNumPoints; ++k) {
      points.emplace_back(uniform(-5.0, 5.0), uniform(-1.5, 1.5), uniform(6.0, 9.0));
      for (int byte = 0; byte < 32; ++byte) {
        descriptors.at<std::uint8_t>(k, byte) = static_cast<std::uint8_t>(random());
      }
    }
    for (const bool late : {false, true}) {
      for (int k = 0; k < kNumPoints; ++k) {
        const TrackId id{late ? kNumPoints + k : k};
        Track track;
        track.id = id;
        for (const auto& [frame, center] : truth.center_in_world) {
          const auto px = PixelOf(frame, k);
          if (IsLate(frame) != late || !px) continue;
          const Eigen::Vector2d noisy_px =
              *px + Eigen::Vector2d(uniform(-0.5, 0.5), uniform(-0.5, 0.5));
          track.observations.push_back({frame, noisy_px, *camera.Unproject(noisy_px), 1.0});
          Features& place = places[frame];
          place.frame = frame;
          place.keypoints_px.push_back(noisy_px);
          place.bearings.push_back(track.observations.back().bearing);
          place.levels.push_back(0);
          place.angles_rad.push_back(0.0F);
          cv::Mat descriptor = descriptors.row(k).clone();
          for (int flip = 0; flip < 8; ++flip) {
            descriptor.at<std::uint8_t>(0, static_cast<int>(random() % 32)) ^=
                static_cast<std::uint8_t>(1U << (random() % 8));
          }
          place.descriptors.push_back(descriptor);
        }
        if (track.observations.size() < 2) continue;
        truth.tracks.push_back(track);
        truth.point_in_world[id] = points[k];
      }
    }
  }

  std::optional<Eigen::Vector2d> PixelOf(FrameId frame, int point) const {
    const auto px =
        camera.Project(truth.cam_from_world.at(frame) *
                       Eigen::Vector3d(points[point] - truth.center_in_world.at(frame)));
    const bool is_inside =
        px && px->x() >= 0.0 && px->x() < camera.width && px->y() >= 0.0 && px->y() < camera.height;
    return is_inside ? px : std::nullopt;
  }

  // The late frames and what only they see, elsewhere.
  Reconstruction LateMoved(const Similarity& move) const {
    Reconstruction map = truth;
    for (auto& [frame, rotation] : map.cam_from_world) {
      if (!IsLate(frame)) continue;
      rotation = move.Move(rotation);
      map.center_in_world[frame] = move.Move(map.center_in_world[frame]);
    }
    for (auto& [track, point] : map.point_in_world) {
      if (track.value >= kNumPoints) point = move.Move(point);
    }
    return map;
  }

  Camera camera = BaCamera();
  std::vector<Eigen::Vector3d> points;
  Reconstruction truth;
  std::map<FrameId, Features> places;
};

inline const Similarity kAway = {1.6, Rotation::Exp({0.1, 0.2, -0.1}), {0.7, -0.3, 0.5}};

// Of a map, those of its frames, tracks and points that are late, or the others.
inline Reconstruction PartOf(Reconstruction map, bool late) {
  std::erase_if(map.cam_from_world, [&](const auto& one) { return IsLate(one.first) != late; });
  std::erase_if(map.center_in_world, [&](const auto& one) { return IsLate(one.first) != late; });
  const auto is_other = [&](TrackId track) { return (track.value >= kNumPoints) != late; };
  std::erase_if(map.point_in_world, [&](const auto& one) { return is_other(one.first); });
  std::erase_if(map.tracks, [&](const Track& track) { return is_other(track.id); });
  return map;
}

}  // namespace rotslam
