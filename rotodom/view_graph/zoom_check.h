#pragma once

#include <map>
#include <vector>

#include "rotodom/camera/camera.h"
#include "rotodom/features/features.h"
#include "rotodom/relative_rotation/relative_rotation.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// Natural logarithm of a ratio of focal lengths from which on it is a zoom: 8 %.
inline constexpr double kLeastLogZoom = 0.08;

/// A change of the focal length from one frame to a later one.
struct Zoom {
  FrameId first;
  FrameId last;
  double factor = 1.0;  // focal length at `last` over that at `first`
};

/// Finds where the focal length changes by more than 8 % within frames that follow one another,
/// ascending.
///
/// A zoom moves all points along rays from the principal point, by the same share of their
/// distance. So does a camera that moves straight ahead, but then near points move more than far
/// ones. Two frames before a zoom tell how far away the points are, up to one scale; each later
/// frame is then resected by these points together with its focal length, until too few of them are
/// in view, and later frames tell depths anew. Without a baseline there are no depths: expansion
/// that leaves a rotation once it is taken out is a zoom, too, where the camera only rotates before
/// and after it; only a wall seen from straight ahead looks the same.
/// @param camera    of all frames, as calibrated.
/// @param features  of the frames, with tracks.
/// Error:   2 % of a ratio of 1.4 for a camera that moves sideways or turns, 9 % for one that moves
///          ahead (0.3 px, f = 500); half of the ratio where the lens goes back meanwhile (0.15 px;
///          not told at 0.3 px; rotodom tests). Real footage: docs/footage.md. A zoom slower than
///          0.5 % a frame may not be found.
/// Cost:    0.3 to 0.6 ms for every third frame; 1 ms more where it zooms.
std::vector<Zoom> FindZooms(const Camera& camera,
                            const std::map<FrameId, Features>& features,
                            const ViewGraph& graph,
                            const RelativeRotationOptions& options);

}  // namespace rotslam
