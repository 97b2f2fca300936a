#pragma once

#include <map>
#include <optional>

#include "rotodom/camera/camera.h"
#include "rotodom/relative_rotation/relative_rotation.h"
#include "rotodom/rolling_shutter/seen_points.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// Estimated readout of a sensor; readout_s is 0 for a global shutter.
struct ReadoutEstimate {
  double readout_s = 0.0;
  ReadoutStart readout_from = ReadoutStart::kTop;
  double sigma_s = 0.0;  // standard deviation of readout_s
  // Improvement over a global shutter in explaining pairs of views: mean gain over its standard
  // error.
  double gain_sigmas = 0.0;
  // The same of the group of pairs that it improves least. The groups are the two halves in time,
  // and the pairs between which the rotation becomes faster or slower.
  double least_gain_sigmas = 0.0;
  double shear_px = 0.0;  // median over the pairs: shear of one view relative to the other
  double noise_px = 0.0;  // standard deviation of their matches
  double frame_s = 0.0;   // time between two frames

  /// Whether the camera has a rolling shutter; false in doubt.
  bool IsRolling() const;
  /// Whether the readout is zero, or too short to matter.
  bool IsGlobal() const;
};

/// Frames tracked as if their shutter were global.
struct TrackedFrames {
  // With consecutive ids; the motion follows from a frame's neighbours in time.
  const std::map<FrameId, SeenPoints>& points;
  const ViewGraph& graph;             // edges between them
  const RotationMap& cam_from_world;  // one per frame
};

/// Estimates the readout of a camera that rotates at varying rates, from orientations and tracks
/// found as if its shutter were global.
///
/// With a rolling shutter, two frames at different rotation rates are sheared relative to each
/// other along rows or columns. Pairs of views are therefore explained, by a rotation or by
/// rotation and translation, with their points moved to mid-frame for readouts of all lengths and
/// all four directions; the readout with the best sum of information criteria is the estimate. An
/// error of the lens deforms pairs by their rotation, whether it becomes faster or slower; a
/// readout deforms them by the change of the rate, one way where it grows and the other way where
/// it falls, and in all of the sequence. Therefore each of these groups of pairs has to confirm the
/// estimate. A shear alone looks like a baseline, which is why many pairs are needed: they agree on
/// one readout, and in a pure rotation all baselines vanish with it. Points are moved to mid-frame
/// by the orientations and by the remaining flow, which is parallax and errors of the orientations.
/// With orientations alone the readout of a hand-held camera comes out too short, because the scene
/// moves against the rotation.
/// @return  nullopt where pairs are too few, rotate too evenly or do not agree on a readout below
///          50 ms and the time between two frames.
/// Error:   0 to 5 % from 120 frames of rendered walks, gimbals and streets with readouts of 20 to
///          40 ms, 0 to 3 % on panoramas resampled with 10 to 30 ms (readout tests). For real
///          cameras see docs/measurements.md.
/// Cost:    1 to 3 s (300 to 600 pairs with 150 matches, one thread).
std::optional<ReadoutEstimate> EstimateReadout(const Camera& camera,
                                               const TrackedFrames& frames,
                                               const RelativeRotationOptions& options,
                                               int num_threads);

}  // namespace rotslam
