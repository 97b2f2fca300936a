#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rotodom/types/maps.h"
#include "rotodom/types/pure_rotation_segment.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// When a camera counts as turning in place, or resting, and for how long.
struct PureRotationOptions {
  // Holding can be switched off, to see what it is good for.
  bool enabled = true;
  // A step from one frame to the next is held when at least this share of the longest edges across
  // it are rotation-only; a slow camera shows its baseline in those first.
  double min_rotation_only_ratio = 0.5;
  // Edges across more frames than this are asked only where there are no others: where a keyframe
  // is followed for long they reach beyond the segment, to where the camera still moved. Those with
  // both ends in a segment are asked again, whether the camera creeps.
  int max_edge_span = 4;
  // Two runs with at most so many steps between them are one when edges from the one to the other
  // show no baseline: something else moved, or a blurred frame matched badly.
  int max_gap = 6;
  // Shorter runs than this, in frames, are left alone: a hand-held camera pauses that long.
  int min_frames = 8;
  // An edge does not turn when its rotation is within so many standard deviations of none. Noise
  // alone stays within half of that but for one in a thousand; real images at rest, whose errors
  // neighbouring pixels share, go beyond that in every fourth edge. `still` is where at least
  // min_rotation_only_ratio of the edges do not turn.
  double still_sigmas = 8.0;

  std::optional<std::string> Problem() const;

  // Not configuration: the members that are not visited; programs and tests set them.
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("enabled", enabled);
    visit("min_frames", min_frames);
  }
};

/// Stretches of frames whose edges give no evidence of a baseline.
///
/// Steps between neighbouring frames are held by a majority of the edges across them; runs of held
/// steps are joined over short gaps where direct edges allow it, then rid of end frames that stand
/// elsewhere and cut where the long edges inside show that the camera creeps.
/// @param cam_from_world  names the frames, in order.
/// @return  ascending, without common frames.
/// Cost:    linear in the number of edges for each time that a run has to be cut.
std::vector<PureRotationSegment> FindPureRotationSegments(const ViewGraph& graph,
                                                          const RotationMap& cam_from_world,
                                                          const PureRotationOptions& options);

/// All frames as one segment, whatever their edges say of a baseline, with the parts in which the
/// camera does not rotate either: for a camera that moves too little for positions.
/// @param cam_from_world  names the frames, in order; at least one.
PureRotationSegment AllFramesAsSegment(const ViewGraph& graph,
                                       const RotationMap& cam_from_world,
                                       const PureRotationOptions& options);

}  // namespace rotslam
