#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// Views at random orientations, and relative rotations of which some are random, too.
enum class GraphShape {
  kRandom,  // every edge joins two random views; as many edges as `edges_per_view` says
  kGrid,    // a square of views, each joined with its neighbours to the right and below
  kChain,   // every view joined with the 4 before it, and one loop edge per 20 views
  kCity,    // streets: every view joined with the next views along its street, and where two
            // streets cross, each view near the crossing with those of the other street
};
std::string NameOf(GraphShape shape);

struct WrongEdgesOptions {
  GraphShape shape = GraphShape::kRandom;
  int num_views = 500;  // about so many
  double edges_per_view = 10.0;
  double noise_deg = 0.5;    // of right edges, per axis
  double wrong_ratio = 0.0;  // share of edges whose rotation is random
  // Half of the wrong edges of a city join random views, the others lie where right ones would.
  std::uint64_t seed = 1;
};

struct WrongEdges {
  std::vector<RelativeRotation> edges;
  std::vector<char> is_wrong;  // by edge
  RotationMap true_cam_from_world;
};

/// Same options, same graph, everywhere. Connected.
WrongEdges MakeWrongEdges(const WrongEdgesOptions& options);

/// Angles between estimate and truth over all views, after the turn of the world that fits best.
struct OrientationErrors {
  double median_deg = 0.0;
  double p99_deg = 0.0;
  double max_deg = 0.0;
};
OrientationErrors CompareOrientations(const RotationMap& estimate, const RotationMap& truth);

}  // namespace rotslam
