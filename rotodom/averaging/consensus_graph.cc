#include "rotodom/averaging/consensus_graph.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <tuple>

#include "rotodom/types/disjoint_sets.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

constexpr int kEdgesPerChunk = 8192;
// Number of consistent cycles at which an edge is decided, and of neighbours tried for cycles of
// four, which bounds the time.
constexpr int kEnoughCycles = 3;
constexpr int kMaxNeighbours = 32;
// A right edge closes at least one in this many of its cycles while most edges are right.
constexpr int kCyclesPerConsistent = 6;

EdgeVerdict ClassifyByTriangles(const ConsensusGraph& graph, int edge) {
  const ConsensusEdge& e = graph.edge(edge);
  const std::span<const ConsensusGraph::Neighbour> at_i = graph.NeighboursOf(e.i);
  const std::span<const ConsensusGraph::Neighbour> at_j = graph.NeighboursOf(e.j);
  int tried = 0;
  int consistent = 0;
  for (std::size_t a = 0, b = 0; a < at_i.size() && b < at_j.size();) {
    if (at_i[a].view != at_j[b].view) {
      ++(at_i[a].view < at_j[b].view ? a : b);
      continue;
    }
    const ConsensusGraph::Neighbour& first = at_i[a++];
    const ConsensusGraph::Neighbour& last = at_j[b++];
    const double variance =
        e.variance + graph.edge(first.edge).variance + graph.edge(last.edge).variance;
    const Eigen::Quaterniond around =
        graph.Along(last.edge, last.view) * graph.Along(first.edge, e.i) * e.j_from_i.conjugate();
    const double tolerance = graph.Tolerance(variance);
    if (!IsEvidence(tolerance)) continue;
    ++tried;
    if (SquaredAngle(around) <= tolerance && ++consistent == kEnoughCycles) break;
  }
  if (consistent > 0 && kCyclesPerConsistent * consistent >= tried) return EdgeVerdict::kConfirmed;
  return tried > 1 ? EdgeVerdict::kContradicted : EdgeVerdict::kUnknown;
}

// @param mark  -1 for every view.
EdgeVerdict ClassifyBySquares(const ConsensusGraph& graph, int edge, std::vector<int>& mark) {
  const ConsensusEdge& e = graph.edge(edge);
  const std::span<const ConsensusGraph::Neighbour> at_i = graph.NeighboursOf(e.i);
  const std::span<const ConsensusGraph::Neighbour> at_j = graph.NeighboursOf(e.j);
  const auto few = [](std::span<const ConsensusGraph::Neighbour> all) {
    return all.first(std::min<std::size_t>(all.size(), kMaxNeighbours));
  };
  for (const ConsensusGraph::Neighbour& n : few(at_j)) mark[n.view] = n.edge;
  int tried = 0;
  int consistent = 0;
  for (const ConsensusGraph::Neighbour& n : few(at_i)) {
    if (n.view == e.j || consistent == kEnoughCycles) continue;
    const Eigen::Quaterniond to_neighbour = graph.Along(n.edge, e.i);
    for (const ConsensusGraph::Neighbour& m : few(graph.NeighboursOf(n.view))) {
      const int back = m.view == e.i || m.view == e.j ? -1 : mark[m.view];
      if (back < 0) continue;
      const double variance = e.variance + graph.edge(n.edge).variance +
                              graph.edge(m.edge).variance + graph.edge(back).variance;
      const Eigen::Quaterniond around = graph.Along(back, m.view) * graph.Along(m.edge, n.view) *
                                        to_neighbour * e.j_from_i.conjugate();
      const double tolerance = graph.Tolerance(variance);
      if (!IsEvidence(tolerance)) continue;
      ++tried;
      if (SquaredAngle(around) <= tolerance && ++consistent == kEnoughCycles) break;
    }
  }
  for (const ConsensusGraph::Neighbour& n : few(at_j)) mark[n.view] = -1;
  if (consistent > 0 && 2 * kCyclesPerConsistent * consistent >= tried)
    return EdgeVerdict::kConfirmed;
  return tried > 2 ? EdgeVerdict::kContradicted : EdgeVerdict::kUnknown;
}

}  // namespace

ConsensusGraph::ConsensusGraph(const ConsensusProblem& problem) : problem_(problem) {
  first_.assign(static_cast<std::size_t>(problem_.num_views) + 1, 0);
  for (const ConsensusEdge& edge : problem_.edges) {
    ++first_[edge.i + 1];
    ++first_[edge.j + 1];
  }
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
  neighbours_.resize(2 * problem_.edges.size());
  std::vector<int> next(first_.begin(), first_.end() - 1);
  for (int k = 0; k < num_edges(); ++k) {
    const ConsensusEdge& edge = problem_.edges[k];
    neighbours_[next[edge.i]++] = {edge.j, k};
    neighbours_[next[edge.j]++] = {edge.i, k};
  }
  for (int view = 0; view < problem_.num_views; ++view) {
    std::sort(neighbours_.begin() + first_[view],
              neighbours_.begin() + first_[view + 1],
              [](const Neighbour& a, const Neighbour& b) {
                return std::tie(a.view, a.edge) < std::tie(b.view, b.edge);
              });
  }
}

std::vector<int> ConsensusGraph::Components() const {
  DisjointSets sets(problem_.num_views);
  for (const ConsensusEdge& edge : problem_.edges) sets.Join(edge.i, edge.j);
  std::vector<int> component(static_cast<std::size_t>(problem_.num_views), -1);
  int count = 0;
  for (int view = 0; view < problem_.num_views; ++view) {
    const int first = sets.Find(view);
    component[view] = first == view ? count++ : component[first];
  }
  return component;
}

std::vector<EdgeVerdict> ClassifyByShortCycles(const ConsensusGraph& graph, int num_threads) {
  std::vector<EdgeVerdict> verdicts(static_cast<std::size_t>(graph.num_edges()));
  const int num_chunks = (graph.num_edges() + kEdgesPerChunk - 1) / kEdgesPerChunk;
  ParallelFor(num_chunks, num_threads, [&](int chunk) {
    std::vector<int> mark(static_cast<std::size_t>(graph.num_views()), -1);
    const int end = std::min(graph.num_edges(), (chunk + 1) * kEdgesPerChunk);
    for (int edge = chunk * kEdgesPerChunk; edge < end; ++edge) {
      verdicts[edge] = ClassifyByTriangles(graph, edge);
      if (verdicts[edge] == EdgeVerdict::kConfirmed) continue;
      const EdgeVerdict by_squares = ClassifyBySquares(graph, edge, mark);
      if (by_squares != EdgeVerdict::kUnknown) verdicts[edge] = by_squares;
    }
  });
  return verdicts;
}

}  // namespace rotslam
