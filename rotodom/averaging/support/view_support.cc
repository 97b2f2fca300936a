#include "rotodom/averaging/support/view_support.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCholesky>

#include "rotodom/averaging/fill.h"

namespace rotslam {
namespace {

// Multiplications of the factorisation up to which the covariances are computed: some 8 s.
constexpr double kMaxDeviationProducts = 2e9;

struct SupportNeighbour {
  int view = 0;
  int edge = 0;
};

// The graph of the edges that count, its views by position.
struct SupportGraph {
  std::vector<FrameId> ids;  // ascending
  std::vector<std::vector<SupportNeighbour>> neighbours;

  int PositionOf(FrameId id) const {
    return static_cast<int>(std::lower_bound(ids.begin(), ids.end(), id) - ids.begin());
  }
  int size() const { return static_cast<int>(ids.size()); }
};

template <class Counts>
SupportGraph MakeSupportGraph(std::span<const RelativeRotation> edges, Counts&& counts) {
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

// Of a depth-first walk over the graph.
struct Walk {
  std::vector<int> order;        // of the views
  std::vector<int> parent;       // -1 at roots
  std::vector<int> parent_edge;  // -1 at roots
  std::vector<int> low;          // the earliest place in the order that the subtree reaches
  std::vector<int> place;        // in the order
  std::vector<int> root;
};

Walk WalkGraph(const SupportGraph& graph) {
  const std::vector<int> none(graph.ids.size(), -1);
  Walk walk{{}, none, none, none, none, none};
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

// Lowers the support of what hangs on a single edge.
void MarkHanging(const SupportGraph& graph,
                 const std::set<FrameId>& held_views,
                 std::vector<int>& support) {
  const Walk walk = WalkGraph(graph);
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

using BlockEntries = std::vector<Eigen::Triplet<double>>;

void AddBlock(int row, int column, const Eigen::Matrix3d& block, BlockEntries& entries) {
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      if (row > column || r >= c) entries.emplace_back(3 * row + r, 3 * column + c, block(r, c));
    }
  }
}

// The blocks of the inverse on the factor's pattern, of which those on the diagonal are returned.
// Z = L^-T D^-1 L^-1 fulfils Z = D^-1 L^-1 + (I - L^T) Z, column by column from the last one.
std::vector<Eigen::Matrix3d> DiagonalBlocksOfInverse(const Eigen::SparseMatrix<double>& L,
                                                     const Eigen::VectorXd& D) {
  const auto n = static_cast<int>(L.cols());
  const int* outer = L.outerIndexPtr();
  const int* inner = L.innerIndexPtr();
  const double* value = L.valuePtr();
  std::vector<double> Z(static_cast<std::size_t>(L.nonZeros()), 0.0);  // below the diagonal
  Eigen::VectorXd diagonal = Eigen::VectorXd::Zero(n);
  Eigen::VectorXd column = Eigen::VectorXd::Zero(n);
  for (int j = n - 1; j >= 0; --j) {
    // column = Z(rows of j, rows of j) L(rows of j, j), the lower triangle used twice.
    for (int p = outer[j]; p < outer[j + 1]; ++p) column[inner[p]] = 0.0;
    for (int p = outer[j]; p < outer[j + 1]; ++p) {
      const int k = inner[p];
      double sum = diagonal[k] * value[p];
      int q = p + 1;
      for (int z = outer[k]; z < outer[k + 1] && q < outer[j + 1]; ++z) {
        if (inner[z] != inner[q]) continue;
        sum += Z[z] * value[q];
        column[inner[q]] += Z[z] * value[p];
        ++q;
      }
      column[k] += sum;
    }
    double product = 0.0;
    for (int p = outer[j]; p < outer[j + 1]; ++p) {
      Z[p] = -column[inner[p]];
      product += value[p] * Z[p];
    }
    diagonal[j] = 1.0 / D[j] - product;
  }
  std::vector<Eigen::Matrix3d> blocks(static_cast<std::size_t>(n / 3), Eigen::Matrix3d::Zero());
  for (int j = 0; j < n; ++j) {
    blocks[j / 3](j % 3, j % 3) = diagonal[j];
    for (int p = outer[j]; p < outer[j + 1]; ++p) {
      const int i = inner[p];
      if (i / 3 != j / 3) continue;
      blocks[j / 3](i % 3, j % 3) = blocks[j / 3](j % 3, i % 3) = Z[p];
    }
  }
  return blocks;
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

OrientationDeviations DeviationsOfViews(std::span<const RelativeRotation> edges,
                                        const std::vector<double>& weights,
                                        const RotationMap& cam_from_world,
                                        const std::set<FrameId>& held_views) {
  const SupportGraph graph =
      MakeSupportGraph(edges, [&](std::size_t k) { return weights[k] > 0.0; });
  const int num_views = graph.size();
  std::vector<Eigen::Matrix3d> R_c_w;
  R_c_w.reserve(graph.ids.size());
  for (const FrameId id : graph.ids) R_c_w.push_back(cam_from_world.at(id).Matrix());
  const auto curvature_of = [&](std::size_t k) -> Eigen::Matrix3d {
    const Eigen::Matrix3d& R = R_c_w[graph.PositionOf(edges[k].j)];
    return weights[k] * R.transpose() * edges[k].covariance.inverse() * R;
  };

  // The fixed views, and one of every other component, are references.
  const Walk walk = WalkGraph(graph);
  std::vector<char> is_reference(graph.ids.size(), 0);
  std::vector<char> has_fixed(graph.ids.size(), 0);  // by root
  for (int v = 0; v < num_views; ++v) {
    if (!held_views.contains(graph.ids[v])) continue;
    is_reference[v] = has_fixed[walk.root[v]] = 1;
  }
  for (int v = 0; v < num_views; ++v) {
    if (walk.root[v] == v && has_fixed[v] == 0) is_reference[v] = 1;
  }
  std::vector<Eigen::Matrix3d> own(graph.ids.size(), Eigen::Matrix3d::Zero());
  BlockEntries pattern;
  std::vector<int> slot(graph.ids.size(), -1);
  std::vector<int> views;
  for (int v = 0; v < num_views; ++v) {
    if (is_reference[v] != 0) continue;
    slot[v] = static_cast<int>(views.size());
    views.push_back(v);
  }
  const auto num_free = static_cast<int>(views.size());
  for (int s = 0; s < num_free; ++s) pattern.emplace_back(s, s, 1.0);
  std::vector<Eigen::Matrix3d> curvatures(edges.size(), Eigen::Matrix3d::Zero());
  for (std::size_t k = 0; k < edges.size(); ++k) {
    if (!(weights[k] > 0.0)) continue;
    const int i = graph.PositionOf(edges[k].i);
    const int j = graph.PositionOf(edges[k].j);
    curvatures[k] = curvature_of(k);
    own[i] += curvatures[k];
    own[j] += curvatures[k];
    if (slot[i] >= 0 && slot[j] >= 0) {
      pattern.emplace_back(std::max(slot[i], slot[j]), std::min(slot[i], slot[j]), 1.0);
    }
  }

  OrientationDeviations deviations;
  const auto put = [&](int v, const Eigen::Matrix3d& in_world) {
    if (graph.neighbours[v].empty()) return;
    const Eigen::Matrix3d in_cam = R_c_w[v] * in_world * R_c_w[v].transpose();
    deviations.covariance[graph.ids[v]] = 0.5 * (in_cam + in_cam.transpose());
  };
  Eigen::SparseMatrix<double> lower(num_free, num_free);
  lower.setFromTriplets(pattern.begin(), pattern.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  if (num_free > 0) Eigen::AMDOrdering<int>()(lower.selfadjointView<Eigen::Lower>(), order);
  std::vector<int> position(views.size());
  for (int k = 0; k < num_free; ++k) position[order.indices()[k]] = k;
  for (Eigen::Triplet<double>& entry : pattern) {
    const int a = position[entry.row()];
    const int b = position[entry.col()];
    entry = Eigen::Triplet<double>(std::min(a, b), std::max(a, b), 1.0);
  }
  Eigen::SparseMatrix<double> upper(num_free, num_free);
  upper.setFromTriplets(pattern.begin(), pattern.end());
  constexpr double kBlockProducts = 27.0;  // of 3 x 3 blocks per entry
  deviations.is_complete = CountFill(upper, kMaxDeviationProducts / kBlockProducts).is_complete;
  if (!deviations.is_complete) {
    for (int v = 0; v < num_views; ++v) {
      if (graph.neighbours[v].empty()) continue;
      put(v,
          is_reference[v] != 0 && has_fixed[walk.root[v]] != 0 ? Eigen::Matrix3d::Zero().eval()
                                                               : own[v].inverse().eval());
    }
    return deviations;
  }

  BlockEntries entries;
  entries.reserve(9 * (views.size() + edges.size()));
  for (int s = 0; s < num_free; ++s) {
    AddBlock(position[s], position[s], own[views[s]], entries);
  }
  for (std::size_t k = 0; k < edges.size(); ++k) {
    if (!(weights[k] > 0.0)) continue;
    const int i = slot[graph.PositionOf(edges[k].i)];
    const int j = slot[graph.PositionOf(edges[k].j)];
    if (i < 0 || j < 0) continue;
    AddBlock(std::max(position[i], position[j]),
             std::min(position[i], position[j]),
             -curvatures[k],
             entries);
  }
  Eigen::SparseMatrix<double> normal(3 * num_free, 3 * num_free);
  normal.setFromTriplets(entries.begin(), entries.end());
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower, Eigen::NaturalOrdering<int>>
      factor(normal);
  std::vector<Eigen::Matrix3d> blocks;
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(3 * num_free, 3);
  if (num_free > 0 && factor.info() == Eigen::Success) {
    blocks = DiagonalBlocksOfInverse(factor.matrixL().nestedExpression(), factor.vectorD());
    // Covariances of the views with the sum of their component's errors.
    Eigen::MatrixXd ones(3 * num_free, 3);
    for (int s = 0; s < num_free; ++s) ones.middleRows<3>(3 * s).setIdentity();
    sums = factor.solve(ones);
  } else if (num_free > 0) {
    deviations.is_complete = false;
    for (int v = 0; v < num_views; ++v) put(v, own[v].inverse());
    return deviations;
  }
  std::vector<Eigen::Matrix3d> total(graph.ids.size(), Eigen::Matrix3d::Zero());  // by root
  std::vector<double> count(graph.ids.size(), 0.0);
  for (int v = 0; v < num_views; ++v) {
    const int root = walk.root[v];
    count[root] += 1.0;
    if (slot[v] >= 0) total[root] += sums.middleRows<3>(3 * position[slot[v]]);
  }
  for (int v = 0; v < num_views; ++v) {
    const int root = walk.root[v];
    Eigen::Matrix3d in_world = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d with_sum = Eigen::Matrix3d::Zero();
    if (slot[v] >= 0) {
      in_world = blocks[position[slot[v]]];
      with_sum = sums.middleRows<3>(3 * position[slot[v]]);
    }
    if (has_fixed[root] == 0) {
      in_world += total[root] / (count[root] * count[root]) -
                  (with_sum + with_sum.transpose()) / count[root];
    }
    put(v, in_world);
  }
  return deviations;
}

}  // namespace rotslam
