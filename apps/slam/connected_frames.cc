#include "apps/slam/connected_frames.h"

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <string>

#include "rotodom/types/disjoint_sets.h"

namespace rotslam {

namespace {

// The first frame of every piece but the first one, by the edges that count. Frames without an edge
// belong to none.
template <class Counts>
std::vector<FrameId> FirstOfPieces(const ViewGraph& graph,
                                   const RotationMap& cam_from_world,
                                   const Counts& counts) {
  DisjointSets pieces;
  for (const RelativeRotation& edge : graph.edges()) {
    if (counts(edge)) pieces.Join(edge.i.value, edge.j.value);
  }
  std::vector<FrameId> firsts;
  bool is_first = true;
  for (const auto& [frame, rotation] : cam_from_world) {
    if (graph.EdgesOf(frame).empty()) continue;
    if (pieces.Find(frame.value) == frame.value && !is_first) firsts.push_back(frame);
    is_first = false;
  }
  return firsts;
}

}  // namespace

bool IsBridged(const GivenRotations& given, FrameId frame) {
  constexpr int kFarthest = 30;  // frames; whatever moves less is tracked that long
  const auto num_frames = static_cast<int>(given.fusion.source.size());
  const auto counts = [&](int k) { return given.CountsFor(FrameId{k}); };
  bool is_before = false;
  for (int k = std::max(0, frame.value - kFarthest); k < frame.value; ++k) is_before |= counts(k);
  bool is_after = false;
  for (int k = frame.value; k < std::min(num_frames, frame.value + kFarthest); ++k) {
    is_after |= counts(k);
  }
  return is_before && is_after;
}

std::vector<FrameId> FindBreaks(const ViewGraph& graph, const RotationMap& cam_from_world) {
  return FirstOfPieces(graph, cam_from_world, [](const RelativeRotation&) { return true; });
}

std::vector<FrameId> FindWeakTies(const Orientations& orientations) {
  const ViewGraph& graph = orientations.graph;
  const auto is_sought = [&](FrameId frame) {
    const auto index = static_cast<std::size_t>(frame.value);
    return index < orientations.reports.size() && orientations.reports[index].weak &&
           orientations.reports[index].searched_wide;
  };
  // Such a frame has one edge to older frames; others come from loops, which were verified.
  const auto has_one_older = [&](FrameId frame) {
    const std::vector<int>& edges = graph.EdgesOf(frame);
    return std::count_if(edges.begin(), edges.end(), [&](int position) {
             return graph.edges()[position].j == frame;
           }) == 1;
  };
  std::vector<FrameId> ties =
      FirstOfPieces(graph, orientations.cam_from_world, [&](const RelativeRotation& edge) {
        return !is_sought(edge.j) || !has_one_older(edge.j);
      });
  // Given orientations tie what the images do not.
  std::erase_if(ties, [&](FrameId frame) {
    return !is_sought(frame) || !has_one_older(frame) ||
           (orientations.given && IsBridged(*orientations.given, frame));
  });
  return ties;
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
