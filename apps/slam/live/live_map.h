#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "rotodom/types/ids.h"
#include "rotodom/types/rotation.h"
#include "rotodom/types/similarity.h"

namespace rotslam {

struct LiveKeyframe {
  FrameId frame;
  double timestamp_s = 0.0;
  Rotation cam_from_world;
  Eigen::Vector3d center_in_world = Eigen::Vector3d::Zero();
  // Component of the map that it belongs to. The scale of a component against the one before is a
  // guess: nothing that both see has a depth.
  int component = 0;
  // The factor by which loops have changed distances around it since it was added.
  double scale = 1.0;
};

struct LivePoint {
  TrackId track;
  Eigen::Vector3d point_in_world;
  std::array<std::uint8_t, 3> rgb = {128, 128, 128};
};

/// The map of a live session at one moment. It never changes; each later map is another object.
struct LiveMap {
  int revision = 0;  // counts the maps, from 1
  // Number of times that loops have moved the map, and by how much they have moved the surroundings
  // of the newest keyframe.
  int num_corrections = 0;
  Similarity moved;
  std::vector<LiveKeyframe> keyframes;  // by frame
  std::vector<LivePoint> points;        // by track

  /// The newest keyframe that has a position; null where there is none.
  const LiveKeyframe* Newest() const { return keyframes.empty() ? nullptr : &keyframes.back(); }
  /// The newest keyframe up to `frame`; the first one where there is none.
  const LiveKeyframe* KeyframeAt(FrameId frame) const;
  /// Null where the map has no such point.
  const LivePoint* FindPoint(TrackId track) const;
};

}  // namespace rotslam
