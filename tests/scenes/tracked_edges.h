#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

enum class TrackedPath {
  kStreet,    // driving between house fronts, tracks 3 to 10 frames long
  kHandheld,  // wandering and turning in a room, tracks 4 to 30 frames long
  kPan,       // turning on the spot in that room
};

/// A small world of points that are tracked from frame to frame, each point with its own noise in
/// each frame, and the relative rotations that follow.
struct TrackedEdgesOptions {
  TrackedPath path = TrackedPath::kStreet;
  int num_views = 60;
  double noise_px = 0.5;   // of each image coordinate
  int reach = 4;           // a view has edges to so many views before it
  int keyframe_every = 0;  // and to the last keyframe beyond; 0: no keyframes
  int min_common = 40;     // points that an edge needs
  std::uint64_t seed = 1;
};

struct TrackedEdge {
  RelativeRotation edge;  // estimated from the noisy points, with its covariance
  // Indices of the points among those of frames i and j; the same index is the same point.
  std::vector<std::array<int, 2>> keypoint_pairs;
};

struct TrackedEdges {
  RotationMap true_cam_from_world;              // the first view is the world
  std::vector<std::vector<TrackedEdge>> edges;  // by their later view
};

/// Each edge's rotation is the least-squares fit of the epipolar constraint (on a pan of the
/// rotation alone) to all points that both frames show; its covariance is the inverse of the normal
/// equations.
TrackedEdges MakeTrackedEdges(const TrackedEdgesOptions& options);

}  // namespace rotslam
