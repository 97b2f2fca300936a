#include "krot/held_stretches.h"

#include <limits>
#include <stdexcept>

#include "rotodom/types/options.h"

namespace rotslam {
namespace {

// Of the edges across the step from frame n-1 to frame n, those of the highest rank: how many there
// are and how many of them show no baseline.
struct Evidence {
  int rank = std::numeric_limits<int>::min();
  int edges = 0;
  int rotation_only = 0;

  void Add(int edge_rank, bool edge_rotation_only) {
    if (edge_rank < rank) return;
    if (edge_rank > rank) *this = {edge_rank, 0, 0};
    ++edges;
    rotation_only += edge_rotation_only;
  }
  double Ratio() const { return edges == 0 ? 0.0 : static_cast<double>(rotation_only) / edges; }
};

}  // namespace

std::optional<std::string> HeldStretchOptions::Problem() const {
  if (!(min_rotation_only_ratio > 0.0 && min_rotation_only_ratio <= 1.0)) {
    return OutOfRange("min_rotation_only_ratio", min_rotation_only_ratio, "above 0 and at most 1");
  }
  if (max_edge_span < 1) return OutOfRange("max_edge_span", max_edge_span, "at least 1");
  if (min_frames < 2) return OutOfRange("min_frames", min_frames, "at least 2");
  return std::nullopt;
}

std::vector<HeldStretch> FindHeldStretches(const ViewGraph& graph,
                                           const RotationMap& cam_from_world,
                                           const HeldStretchOptions& options) {
  if (const auto problem = options.Problem())
    throw std::invalid_argument("HeldStretchOptions: " + *problem);
  if (!options.enabled || cam_from_world.empty()) return {};
  std::vector<FrameId> frames;
  std::map<FrameId, int> position;
  for (const auto& [frame, rotation] : cam_from_world) {
    position[frame] = static_cast<int>(frames.size());
    frames.push_back(frame);
  }
  std::vector<Evidence> steps(frames.size());  // steps[n]: from frame n-1 to frame n
  for (const RelativeRotation& edge : graph.edges()) {
    if (!position.contains(edge.i) || !position.contains(edge.j)) {
      throw std::invalid_argument("FindHeldStretches: an edge names a frame without orientation");
    }
    const int first = position.at(edge.i);
    const int last = position.at(edge.j);
    // Long edges before short ones, but not too long ones.
    const int span = last - first;
    const int rank = span <= options.max_edge_span ? span : -span;
    for (int n = first + 1; n <= last; ++n) steps[n].Add(rank, edge.rotation_only);
  }
  std::vector<HeldStretch> stretches;
  const int count = static_cast<int>(frames.size());
  for (int n = 1; n < count; ++n) {
    if (steps[n].Ratio() < options.min_rotation_only_ratio) continue;
    const int first = n - 1;
    double sum = 0.0;
    while (n < count && steps[n].Ratio() >= options.min_rotation_only_ratio)
      sum += steps[n++].Ratio();
    const int last = n - 1;
    if (last - first + 1 >= options.min_frames) {
      stretches.push_back({frames[first], frames[last], sum / (last - first)});
    }
  }
  return stretches;
}

}  // namespace rotslam
