#include "rotodom/averaging/support/edge_positions.h"

#include <algorithm>
#include <stdexcept>

#include "rotodom/averaging/laplacian_solver.h"
#include "rotodom/types/disjoint_sets.h"

namespace rotslam {
namespace {

constexpr double kCenterDamping = 1e-14;
// Each solution reduces the residual by 1e-4, or by less where its iterations run out.
constexpr int kMaxCenterSteps = 20;
constexpr double kCenterTolerance = 1e-10;

struct CenterGraph {
  std::vector<FrameId> ids;  // ascending
  std::vector<int> slot;     // of a view among the free ones, then the others
  std::vector<FrameId> by_slot;
  int num_free = 0;
};

CenterGraph MakeCenterGraph(std::span<const RelativeRotation> edges,
                            std::span<const double> weights,
                            const std::set<FrameId>& held_views) {
  CenterGraph graph;
  for (std::size_t k = 0; k < edges.size(); ++k) {
    if (!(weights[k] > 0.0)) continue;
    graph.ids.push_back(edges[k].i);
    graph.ids.push_back(edges[k].j);
  }
  std::sort(graph.ids.begin(), graph.ids.end());
  graph.ids.erase(std::unique(graph.ids.begin(), graph.ids.end()), graph.ids.end());
  const auto position = [&](FrameId id) {
    return static_cast<int>(std::lower_bound(graph.ids.begin(), graph.ids.end(), id) -
                            graph.ids.begin());
  };
  DisjointSets sets(static_cast<int>(graph.ids.size()));
  for (std::size_t k = 0; k < edges.size(); ++k) {
    if (weights[k] > 0.0) sets.Join(position(edges[k].i), position(edges[k].j));
  }
  std::vector<char> has_held(graph.ids.size(), 0);  // by the set's name
  std::vector<char> is_held(graph.ids.size(), 0);
  for (int v = 0; v < static_cast<int>(graph.ids.size()); ++v) {
    if (held_views.contains(graph.ids[v])) is_held[v] = has_held[sets.Find(v)] = 1;
  }
  for (int v = 0; v < static_cast<int>(graph.ids.size()); ++v) {
    if (sets.Find(v) == v && has_held[v] == 0) is_held[v] = 1;
  }
  graph.slot.resize(graph.ids.size());
  for (const bool held : {false, true}) {
    for (std::size_t v = 0; v < graph.ids.size(); ++v) {
      if ((is_held[v] != 0) != held) continue;
      graph.slot[v] = static_cast<int>(graph.by_slot.size());
      graph.by_slot.push_back(graph.ids[v]);
    }
    if (!held) graph.num_free = static_cast<int>(graph.by_slot.size());
  }
  return graph;
}

}  // namespace

CenterMap FitCenters(std::span<const RelativeRotation> edges,
                     std::span<const Eigen::Vector3d> j_in_i,
                     std::span<const double> weights,
                     const RotationMap& cam_from_world,
                     const CenterMap& center_in_world,
                     const std::set<FrameId>& held_views) {
  if (edges.size() != j_in_i.size() || edges.size() != weights.size()) {
    throw std::invalid_argument("FitCenters: needs one translation and one weight per edge");
  }
  const CenterGraph graph = MakeCenterGraph(edges, weights, held_views);
  std::vector<LaplacianEdge> laplacian;
  std::vector<Eigen::Vector3d> step_in_world;
  for (std::size_t k = 0; k < edges.size(); ++k) {
    if (!(weights[k] > 0.0)) continue;
    const auto slot_of = [&](FrameId id) {
      return graph
          .slot[std::lower_bound(graph.ids.begin(), graph.ids.end(), id) - graph.ids.begin()];
    };
    const auto i_from_world = cam_from_world.find(edges[k].i);
    if (i_from_world == cam_from_world.end()) {
      throw std::invalid_argument("FitCenters: an edge's view has no orientation");
    }
    laplacian.push_back(
        {slot_of(edges[k].i), slot_of(edges[k].j), weights[k] * Eigen::Matrix3d::Identity(), true});
    step_in_world.push_back(i_from_world->second.Inverse() * j_in_i[k]);
  }
  std::vector<Eigen::Vector3d> center;
  for (const FrameId view : graph.by_slot) {
    const auto given = center_in_world.find(view);
    center.push_back(given == center_in_world.end() ? Eigen::Vector3d::Zero().eval()
                                                    : given->second);
  }
  LaplacianSolver solver(graph.num_free);
  double first = -1.0;
  for (int step = 0; step < kMaxCenterSteps && graph.num_free > 0; ++step) {
    Eigen::VectorXd pull = Eigen::VectorXd::Zero(3 * graph.num_free);
    for (std::size_t k = 0; k < laplacian.size(); ++k) {
      const LaplacianEdge& edge = laplacian[k];
      const Eigen::Vector3d residual =
          edge.curvature(0, 0) * (step_in_world[k] - (center[edge.j] - center[edge.i]));
      if (edge.j < graph.num_free) pull.segment<3>(3 * edge.j) += residual;
      if (edge.i < graph.num_free) pull.segment<3>(3 * edge.i) -= residual;
    }
    if (first < 0.0) first = pull.norm();
    if (pull.norm() <= kCenterTolerance * first) break;
    if (!solver.Solve(laplacian, kCenterDamping, pull)) break;
    for (int v = 0; v < graph.num_free; ++v) center[v] += pull.segment<3>(3 * v);
  }
  CenterMap centers;
  for (std::size_t v = 0; v < graph.ids.size(); ++v) {
    centers.emplace_hint(centers.end(), graph.ids[v], center[graph.slot[v]]);
  }
  return centers;
}

}  // namespace rotslam
