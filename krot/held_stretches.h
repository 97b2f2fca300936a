#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rotodom/types/held_stretch.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

struct HeldStretchOptions {
  // Holding can be switched off, to see what it is good for.
  bool enabled = true;
  // A step from one frame to the next is held when at least this share of the longest edges across
  // it are rotation-only; a slow camera shows its baseline in those first.
  double min_rotation_only_ratio = 0.5;
  // Edges across more frames than this are asked only where there are no others: where a keyframe
  // is followed for long they reach beyond the stretch, to where the camera still moved.
  int max_edge_span = 4;
  // Shorter runs than this, in frames, are left alone: a hand-held camera pauses that long.
  int min_frames = 8;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("enabled", enabled);
    visit("min_rotation_only_ratio", min_rotation_only_ratio);
    visit("max_edge_span", max_edge_span);
    visit("min_frames", min_frames);
  }
};

/// Stretches of frames whose edges give no evidence of a baseline.
/// @param cam_from_world  names the frames, in order.
std::vector<HeldStretch> FindHeldStretches(const ViewGraph& graph,
                                           const RotationMap& cam_from_world,
                                           const HeldStretchOptions& options);

}  // namespace rotslam
