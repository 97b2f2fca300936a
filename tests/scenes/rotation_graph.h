#pragma once

#include <cstdint>

#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// A turning camera's view-graph, its edges measured with independent errors.
struct RotationGraphOptions {
  int num_views = 100;
  int reach = 4;             // a view has edges to so many views before it
  int keyframe_every = 0;    // every so many views one is a keyframe; 0: none
  int keyframe_reach = 2;    // a view has edges to so many keyframes beyond its reach
  double step_deg = 3.0;     // turn from view to view, per axis
  double noise_deg = 0.05;   // of an edge, per axis
  double wrong_ratio = 0.0;  // share of edges that are 1 to 60 deg off
  bool wrong_steps = false;  // the edges to the view before may be wrong, too
  std::uint64_t seed = 1;
};

struct RotationGraph {
  ViewGraph graph;
  RotationMap true_cam_from_world;
  RotationMap chained_cam_from_world;  // over the edges from view to view
};

/// Same options, same graph, everywhere. Views are 0 .. num_views - 1, the first at the identity.
RotationGraph MakeRotationGraph(const RotationGraphOptions& options);

/// Angles between estimate and truth, degrees.
struct RotationErrors {
  double rms_deg = 0.0;  // of the orientations, the first ones laid over each other
  double max_deg = 0.0;
  double step_rms_deg = 0.0;  // of the turns from view to view
};
RotationErrors CompareRotations(const RotationMap& estimate, const RotationMap& truth);

}  // namespace rotslam
