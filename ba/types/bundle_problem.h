#pragma once

#include <map>
#include <set>

#include "rotodom/camera/camera.h"
#include "rotodom/types/reconstruction.h"

namespace rotslam {

/// The map to refine. All frames share one camera.
struct BundleProblem {
  Camera camera;
  /// Poses in any gauge, and tracks with observations in pixels; bearings are the camera's of
  /// these. Its points are not looked at: all are triangulated. Observations in frames without a
  /// pose are left out.
  Reconstruction start;
  /// Frame -> frame whose centre it shares. A pure rotation has one centre, and so one parameter
  /// block: the positions in the result are equal to the last bit. Chains are followed.
  std::map<FrameId, FrameId> shared_center;
  /// Frames whose pose does not move: the older side of a window. When empty, the first frame is
  /// held and the scale stays.
  std::set<FrameId> fixed_frames;
  /// Standard deviations per axis, positive, of the start's orientations where those are
  /// measurements themselves, of a gimbal or another system: where rotations move, they move
  /// against these. Then no orientation is held for the gauge.
  std::map<FrameId, double> rotation_sigma_rad;
};

}  // namespace rotslam
