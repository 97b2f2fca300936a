#include "apps/paper_method/paper_graph.h"

#include <iterator>
#include <stdexcept>
#include <utility>

#include "apps/paper_method/eigensolver.h"
#include "apps/paper_method/equal_averaging.h"
#include "rotodom/types/parallel.h"
#include "rotodom/types/splitmix64.h"

namespace rotslam {
namespace {

// Deviation that files state of each edge: the method estimates none.
constexpr double kStatedSigmaDeg = 0.1;

}  // namespace

PairSolver EigensolverPairs() {
  return [](const PairMatches& matches,
            const Rotation& start_j_from_i,
            std::uint64_t seed) -> std::optional<RelativeRotation> {
    const auto estimate = EstimateByEigensolver(matches.pairs, start_j_from_i, seed);
    if (!estimate) return std::nullopt;
    const double sigma_rad = kStatedSigmaDeg * kRadFromDeg;
    RelativeRotation edge;
    edge.i = matches.i;
    edge.j = matches.j;
    edge.j_from_i = estimate->j_from_i;
    edge.covariance = sigma_rad * sigma_rad * Eigen::Matrix3d::Identity();
    edge.translation_direction = estimate->translation_direction;
    edge.num_inliers = static_cast<int>(estimate->inliers.size());
    return edge;
  };
}

PaperGraph::PaperGraph(const PaperGraphOptions& options) : options_(options) {
  if (const auto problem = options.averaging.Problem()) {
    throw std::invalid_argument("averaging: " + *problem);
  }
  if (!options_.solver) options_.solver = EigensolverPairs();
  if (!options_.averager) options_.averager = AverageEqually;
}

std::optional<RelativeRotation> PaperGraph::Estimate(const PairMatches& matches,
                                                     const Rotation& start_j_from_i) const {
  if (static_cast<int>(matches.pairs.size()) <= options_.min_edge_inliers) return std::nullopt;
  const std::uint64_t seed =
      HashOf(options_.seed + HashOf((static_cast<std::uint64_t>(matches.i.value) << 32U) |
                                    static_cast<std::uint64_t>(matches.j.value)));
  std::optional<RelativeRotation> edge = options_.solver(matches, start_j_from_i, seed);
  if (edge && edge->num_inliers <= options_.min_edge_inliers) edge.reset();
  return edge;
}

std::vector<std::optional<RelativeRotation>> PaperGraph::EstimateAll(
    std::span<const PairMatches> matches,
    const std::function<Rotation(const PairMatches&)>& start_of) const {
  std::vector<std::optional<RelativeRotation>> edges(matches.size());
  ParallelFor(static_cast<int>(matches.size()), options_.num_threads, [&](int k) {
    edges[k] = Estimate(matches[k], start_of(matches[k]));
  });
  return edges;
}

Rotation PaperGraph::RelativeRotationOf(FrameId i, FrameId j) const {
  if (const RelativeRotation* edge = i < j ? graph_.FindEdge(i, j) : nullptr) return edge->j_from_i;
  const auto cam_i = cam_from_world_.find(i);
  const auto cam_j = cam_from_world_.find(j);
  if (cam_i == cam_from_world_.end() || cam_j == cam_from_world_.end()) return {};
  return cam_j->second * cam_i->second.Inverse();
}

PaperGraph::Step PaperGraph::AddFrame(FrameId frame, std::span<const PairMatches> matches) {
  const auto previous = [](FrameId id) { return FrameId{id.value - 1}; };
  std::vector<std::optional<RelativeRotation>> edges =
      EstimateAll(matches, [&](const PairMatches& pair) {
        return RelativeRotationOf(previous(pair.i), previous(pair.j));
      });
  Step step;
  for (std::optional<RelativeRotation>& edge : edges) {
    if (!edge) continue;
    graph_.AddEdge(*edge);
    step.edges.push_back(*std::move(edge));
  }
  if (!step.edges.empty()) {
    const RelativeRotation& newest = step.edges.front();
    cam_from_world_[frame] = newest.j_from_i * cam_from_world_.at(newest.i);
  } else if (cam_from_world_.empty()) {
    cam_from_world_[frame] = Rotation();
  } else {
    step.predicted_only = true;
    const FrameId last = cam_from_world_.rbegin()->first;
    cam_from_world_[frame] = RelativeRotationOf(previous(last), last) * cam_from_world_.at(last);
  }
  Average(ViewsToAverage(cam_from_world_, options_.averaging));
  return step;
}

void PaperGraph::Average(const std::set<FrameId>& free_views) {
  if (free_views.empty()) return;
  for (const auto& [view, rotation] : options_.averager(graph_, cam_from_world_, free_views)) {
    cam_from_world_[view] = rotation;
  }
}

std::vector<std::optional<RelativeRotation>> PaperGraph::VerifyLoops(
    std::span<const PairMatches> candidates) const {
  if (cam_from_world_.empty()) return {};
  const FrameId newest = cam_from_world_.rbegin()->first;
  const Rotation start = RelativeRotationOf(FrameId{newest.value - 1}, newest);
  return EstimateAll(candidates, [&start](const PairMatches&) { return Rotation(start); });
}

void PaperGraph::CloseLoops(std::span<const RelativeRotation> edges) {
  if (edges.empty()) return;
  for (const RelativeRotation& edge : edges) graph_.AddEdge(edge);
  std::set<FrameId> free_views;
  for (auto entry = std::next(cam_from_world_.begin()); entry != cam_from_world_.end(); ++entry) {
    free_views.insert(free_views.end(), entry->first);
  }
  Average(free_views);
}

}  // namespace rotslam
