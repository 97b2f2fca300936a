#include "apps/paper_method/equal_averaging.h"

#include <algorithm>
#include <map>
#include <vector>

#include "rotodom/averaging/edge_system.h"

namespace rotslam {
namespace {

// Loss, largest step of the last iteration, and iterations of each stage (MRO).
constexpr double kLossDeg = 5.0;
constexpr double kMinStepRad = 1e-3;
constexpr int kMaxIterations = 100;
// Deviation that all edges are given; only its ratio to the loss matters. The L1 cost is quadratic
// below a tenth of it.
constexpr double kEdgeSigmaDeg = 0.01;

// Edges with a free view, each once, in the order of the graph.
std::vector<int> EdgesAt(const ViewGraph& graph, const std::set<FrameId>& free_views) {
  std::vector<int> edges;
  for (const FrameId view : free_views) {
    const std::vector<int>& of_view = graph.EdgesOf(view);
    edges.insert(edges.end(), of_view.begin(), of_view.end());
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

void Iterate(EdgeLoss loss, EdgeSystem& system) {
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    if (system.Step(loss) < kMinStepRad) return;
  }
}

}  // namespace

RotationMap AverageEqually(const ViewGraph& graph,
                           const RotationMap& cam_from_world,
                           const std::set<FrameId>& free_views) {
  std::vector<const RelativeRotation*> edges;
  std::map<FrameId, int> positions;  // free views first, then anchors
  for (const FrameId view : free_views) positions.emplace(view, -1);
  bool is_anchored = false;
  for (const int index : EdgesAt(graph, free_views)) {
    const RelativeRotation& edge = graph.edges()[index];
    if (!cam_from_world.contains(edge.i) || !cam_from_world.contains(edge.j)) continue;
    edges.push_back(&edge);
    is_anchored |= !free_views.contains(edge.i) || !free_views.contains(edge.j);
  }
  RotationMap averaged;
  for (const FrameId view : free_views) averaged[view] = cam_from_world.at(view);
  if (edges.empty()) return averaged;

  std::vector<Eigen::Quaterniond> orientations;
  const auto add = [&](FrameId view) {
    positions[view] = static_cast<int>(orientations.size());
    orientations.push_back(cam_from_world.at(view).Quaternion());
  };
  const FrameId held = is_anchored ? FrameId{} : *free_views.begin();
  for (const FrameId view : free_views) {
    if (view != held) add(view);
  }
  const int num_free = static_cast<int>(orientations.size());
  if (num_free == 0) return averaged;
  if (!is_anchored) add(held);
  for (const RelativeRotation* edge : edges) {
    for (const FrameId view : {edge->i, edge->j}) {
      if (!positions.contains(view)) add(view);
    }
  }
  EdgeSystem system(std::move(orientations), num_free, kLossDeg / kEdgeSigmaDeg);
  const double sigma_rad = kEdgeSigmaDeg * kRadFromDeg;
  const Eigen::Matrix3d covariance = sigma_rad * sigma_rad * Eigen::Matrix3d::Identity();
  for (const RelativeRotation* edge : edges) {
    system.AddEdge(positions.at(edge->i), positions.at(edge->j), edge->j_from_i, covariance);
  }
  Iterate(EdgeLoss::kL1, system);
  Iterate(EdgeLoss::kGemanMcClure, system);
  for (auto& [view, rotation] : averaged) {
    const int position = positions.at(view);
    if (position < num_free) rotation = system.CamFromWorld(position);
  }
  return averaged;
}

}  // namespace rotslam
