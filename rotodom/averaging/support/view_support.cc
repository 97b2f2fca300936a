#include "rotodom/averaging/support/view_support.h"

#include <algorithm>

#include "rotodom/averaging/support/support_graph.h"

namespace rotslam {
namespace {

// Batagelj & Zaversnik, An O(m) Algorithm for Cores Decomposition of Networks, 2003: views in
// buckets of their degrees, taken from the lowest on.
std::vector<int> CoreNumbers(const SupportGraph& graph) {
  std::vector<int> degree(graph.ids.size());
  int largest = 0;
  for (int v = 0; v < graph.size(); ++v) {
    degree[v] = static_cast<int>(graph.neighbours[v].size());
    largest = std::max(largest, degree[v]);
  }
  std::vector<std::vector<int>> buckets(static_cast<std::size_t>(largest) + 1);
  for (int v = 0; v < graph.size(); ++v) buckets[degree[v]].push_back(v);
  std::vector<char> is_done(graph.ids.size(), 0);
  for (int k = 0; k <= largest; ++k) {
    for (std::size_t n = 0; n < buckets[k].size(); ++n) {
      const int v = buckets[k][n];
      if (is_done[v] != 0 || degree[v] != k) continue;
      is_done[v] = 1;
      for (const SupportNeighbour& next : graph.neighbours[v]) {
        if (is_done[next.view] != 0 || degree[next.view] <= k) continue;
        buckets[--degree[next.view]].push_back(next.view);
      }
    }
  }
  return degree;
}

// Lowers the support of what hangs on a single edge.
void MarkHanging(const SupportGraph& graph,
                 const std::set<FrameId>& held_views,
                 std::vector<int>& support) {
  const GraphWalk walk = WalkGraph(graph);
  const std::size_t n = graph.ids.size();
  std::vector<int> size(n, 1);
  std::vector<int> num_held(n, 0);
  for (const FrameId view : held_views) {
    const int v = graph.PositionOf(view);
    if (v < graph.size() && graph.ids[v] == view) num_held[v] = 1;
  }
  for (std::size_t k = n; k-- > 0;) {
    const int v = walk.order[k];
    if (walk.parent[v] < 0) continue;
    size[walk.parent[v]] += size[v];
    num_held[walk.parent[v]] += num_held[v];
  }
  std::vector<char> hangs(n, 0);
  // By root: below the deepest bridge whose lower side is the larger one.
  std::vector<int> deepest_main(n, -1);
  for (const int v : walk.order) {
    const int parent = walk.parent[v];
    if (parent < 0) continue;
    const bool is_bridge = walk.low[v] > walk.place[parent];
    if (!is_bridge) continue;
    const int root = walk.root[v];
    const bool inside_is_held = num_held[v] > 0;
    const bool outside_is_held = num_held[root] > num_held[v];
    const bool inside_hangs = inside_is_held == outside_is_held
                                  ? 2 * size[v] <= size[root] && !inside_is_held
                                  : outside_is_held;
    if (inside_hangs) {
      hangs[v] = 1;
    } else if (!outside_is_held) {
      // The larger side lies below; such bridges follow one another down one path.
      deepest_main[root] = v;
    }
  }
  for (const int v : walk.order) {
    if (walk.parent[v] >= 0 && hangs[walk.parent[v]] != 0) hangs[v] = 1;
  }
  // All but the subtree of the deepest one hangs.
  std::vector<char> is_in_main(n, 0);
  for (const int v : walk.order) {
    const int main = deepest_main[walk.root[v]];
    if (main < 0) continue;
    is_in_main[v] = v == main || (walk.parent[v] >= 0 && is_in_main[walk.parent[v]] != 0) ? 1 : 0;
    if (is_in_main[v] == 0) hangs[v] = 1;
  }
  for (std::size_t v = 0; v < n; ++v) {
    if (hangs[v] != 0) support[v] = std::min(support[v], 1);
  }
}

}  // namespace

std::map<FrameId, int> SupportOfViews(std::span<const RelativeRotation> edges,
                                      const std::vector<char>& is_inlier,
                                      const std::set<FrameId>& held_views) {
  const SupportGraph graph =
      MakeSupportGraph(edges, [&](std::size_t k) { return is_inlier[k] != 0; });
  std::vector<int> support = CoreNumbers(graph);
  MarkHanging(graph, held_views, support);
  std::map<FrameId, int> by_view;
  for (int v = 0; v < graph.size(); ++v)
    by_view.emplace_hint(by_view.end(), graph.ids[v], support[v]);
  return by_view;
}

}  // namespace rotslam
