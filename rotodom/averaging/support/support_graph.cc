#include "rotodom/averaging/support/support_graph.h"

namespace rotslam {

SupportGraph MakeSupportGraph(std::span<const RelativeRotation> edges,
                              const std::function<bool(std::size_t)>& counts) {
  SupportGraph graph;
  graph.ids.reserve(2 * edges.size());
  for (const RelativeRotation& edge : edges) {
    graph.ids.push_back(edge.i);
    graph.ids.push_back(edge.j);
  }
  std::sort(graph.ids.begin(), graph.ids.end());
  graph.ids.erase(std::unique(graph.ids.begin(), graph.ids.end()), graph.ids.end());
  graph.neighbours.resize(graph.ids.size());
  for (std::size_t k = 0; k < edges.size(); ++k) {
    if (!counts(k)) continue;
    const int i = graph.PositionOf(edges[k].i);
    const int j = graph.PositionOf(edges[k].j);
    graph.neighbours[i].push_back({j, static_cast<int>(k)});
    graph.neighbours[j].push_back({i, static_cast<int>(k)});
  }
  return graph;
}

GraphWalk WalkGraph(const SupportGraph& graph) {
  const std::vector<int> none(graph.ids.size(), -1);
  GraphWalk walk{{}, none, none, none, none, none};
  std::vector<std::size_t> next(graph.ids.size(), 0);
  std::vector<int> stack;
  for (int start = 0; start < graph.size(); ++start) {
    if (walk.place[start] >= 0) continue;
    const auto enter = [&](int v) {
      walk.place[v] = walk.low[v] = static_cast<int>(walk.order.size());
      walk.root[v] = start;
      walk.order.push_back(v);
      stack.push_back(v);
    };
    enter(start);
    while (!stack.empty()) {
      const int v = stack.back();
      if (next[v] < graph.neighbours[v].size()) {
        const SupportNeighbour step = graph.neighbours[v][next[v]++];
        if (step.edge == walk.parent_edge[v]) continue;
        if (walk.place[step.view] >= 0) {
          walk.low[v] = std::min(walk.low[v], walk.place[step.view]);
          continue;
        }
        walk.parent[step.view] = v;
        walk.parent_edge[step.view] = step.edge;
        enter(step.view);
        continue;
      }
      stack.pop_back();
      if (walk.parent[v] >= 0) {
        walk.low[walk.parent[v]] = std::min(walk.low[walk.parent[v]], walk.low[v]);
      }
    }
  }
  return walk;
}

}  // namespace rotslam
