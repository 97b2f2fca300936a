#include "apps/slam/connected_frames.h"

#include <stdexcept>
#include <string>

#include "rotodom/types/disjoint_sets.h"

namespace rotslam {

std::vector<FrameId> FindBreaks(const ViewGraph& graph, const RotationMap& cam_from_world) {
  DisjointSets pieces;
  for (const RelativeRotation& edge : graph.edges()) pieces.Join(edge.i.value, edge.j.value);
  std::vector<FrameId> breaks;
  bool is_first = true;
  for (const auto& [frame, rotation] : cam_from_world) {
    if (graph.EdgesOf(frame).empty()) continue;
    if (pieces.Find(frame.value) == frame.value && !is_first) breaks.push_back(frame);
    is_first = false;
  }
  return breaks;
}

void RequireFramesAndEdges(const Orientations& orientations) {
  const std::size_t num_frames = orientations.timestamps_s.size();
  if (num_frames < 3) {
    throw std::runtime_error("only " + std::to_string(num_frames) +
                             " frames could be read; at least 3 are needed");
  }
  if (orientations.graph.edges().empty()) {
    throw std::runtime_error(
        "no two of the " + std::to_string(num_frames) +
        " frames could be matched: the images show too few corners in common; check "
        "that they are in focus, exposed and in order");
  }
}

}  // namespace rotslam
