#include "rotodom/averaging/consensus_tree.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <queue>
#include <tuple>

#include "rotodom/types/splitmix64.h"

namespace rotslam {
namespace {

// Cost of an edge in a path: unconfirmed edges, and those that short cycles contradict.
constexpr double kUnconfirmedClass = 1.0;
constexpr double kContradictedClass = 3.0;

// Candidates for the tree, best last.
using Candidate = std::tuple<double, double, int, int>;  // class, variance, view, edge

// A pseudo-random number from 0 to 1.
double UnitHash(std::uint64_t seed, std::uint64_t trial, std::uint64_t edge) {
  const std::uint64_t bits = HashOf(((seed * 0x2545f4914f6cdd1dU + trial) << 32) + edge);
  return static_cast<double>(bits >> 11) * 0x1p-53;
}

}  // namespace

ConsensusTree::ConsensusTree(const ConsensusGraph& graph,
                             const EdgeKnowledge& knowledge,
                             const std::vector<int>& roots,
                             int trial)
    : graph_(graph), nodes_(static_cast<std::size_t>(graph.num_views())) {
  order_.reserve(nodes_.size());
  std::vector<char> is_settled(nodes_.size(), 0);
  std::vector<char> is_entered(nodes_.size(), 0);
  std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> queue;
  for (const int root : roots) queue.emplace(0, 0.0, root, -1);
  while (!queue.empty()) {
    const auto [path_class, variance, view, edge] = queue.top();
    queue.pop();
    if (is_settled[view] != 0) continue;
    const int piece = knowledge.piece[view];
    if (edge >= 0 && !knowledge.IsConfirmed(edge) && is_entered[piece] != 0) continue;
    is_settled[view] = 1;
    is_entered[piece] = 1;
    nodes_[view].variance = variance;
    Settle(view, edge);
    for (const ConsensusGraph::Neighbour& n : graph.NeighboursOf(view)) {
      if (is_settled[n.view] != 0) continue;
      const EdgeVerdict verdict = knowledge.verdict[n.edge];
      double extra = 0.0;
      if (verdict != EdgeVerdict::kConfirmed) {
        if (is_entered[knowledge.piece[n.view]] != 0) continue;
        extra = verdict == EdgeVerdict::kUnknown ? kUnconfirmedClass : kContradictedClass;
        if (trial > 0) extra *= 0.5 + UnitHash(graph.problem().seed, trial, n.edge);
      }
      queue.emplace(path_class + extra, variance + graph.edge(n.edge).variance, n.view, n.edge);
    }
  }
}

void ConsensusTree::Settle(int view, int edge) {
  order_.push_back(view);
  Node& node = nodes_[view];
  node.edge = edge;
  if (edge < 0) {
    node.jump = view;
    return;
  }
  const ConsensusEdge& e = graph_.edge(edge);
  node.parent = e.i == view ? e.j : e.i;
  const Node& parent = nodes_[node.parent];
  const Node& jump = nodes_[parent.jump];
  node.depth = parent.depth + 1;
  node.jump =
      parent.depth - jump.depth == jump.depth - nodes_[jump.jump].depth ? jump.jump : node.parent;
}

int ConsensusTree::CommonAncestor(int a, int b) const {
  while (nodes_[a].depth != nodes_[b].depth) {
    int& deeper = nodes_[a].depth > nodes_[b].depth ? a : b;
    const int depth = std::min(nodes_[a].depth, nodes_[b].depth);
    const Node& node = nodes_[deeper];
    deeper = nodes_[node.jump].depth >= depth ? node.jump : node.parent;
  }
  while (a != b) {
    if (nodes_[a].depth == 0) return -1;
    const bool jumps = nodes_[a].jump != nodes_[b].jump;
    a = jumps ? nodes_[a].jump : nodes_[a].parent;
    b = jumps ? nodes_[b].jump : nodes_[b].parent;
  }
  return a;
}

double ConsensusTree::PathVariance(int a, int b) const {
  const int common = CommonAncestor(a, b);
  const double to_common = common < 0 ? 0.0 : nodes_[common].variance;
  const double drift_factor = graph_.problem().drift_factor;
  return drift_factor * drift_factor * (nodes_[a].variance + nodes_[b].variance - 2.0 * to_common);
}

void ConsensusTree::Chain(std::vector<Eigen::Quaterniond>& cam_from_world) const {
  for (const int view : order_) {
    const Node& node = nodes_[view];
    if (node.edge >= 0) {
      cam_from_world[view] =
          (graph_.Along(node.edge, node.parent) * cam_from_world[node.parent]).normalized();
    } else if (graph_.problem().is_held[view] == 0) {
      cam_from_world[view] = Eigen::Quaterniond::Identity();
    }
  }
}

}  // namespace rotslam
