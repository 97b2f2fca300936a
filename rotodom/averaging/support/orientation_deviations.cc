#include "rotodom/averaging/support/orientation_deviations.h"

#include <algorithm>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCholesky>

#include "rotodom/averaging/fill.h"
#include "rotodom/averaging/support/support_graph.h"

namespace rotslam {
namespace {

// Multiplications of the factorisation up to which the covariances are computed: some 8 s.
constexpr double kMaxDeviationProducts = 2e9;

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

// Views that the others' errors are relative to: the fixed ones, and one of every other component.
struct References {
  std::vector<char> is_reference;  // by view
  std::vector<char> has_fixed;     // by root of the component
};

References FindReferences(const SupportGraph& graph,
                          const GraphWalk& walk,
                          const std::set<FrameId>& held_views) {
  References references = {std::vector<char>(graph.ids.size(), 0),
                           std::vector<char>(graph.ids.size(), 0)};
  for (int v = 0; v < graph.size(); ++v) {
    if (!held_views.contains(graph.ids[v])) continue;
    references.is_reference[v] = references.has_fixed[walk.root[v]] = 1;
  }
  for (int v = 0; v < graph.size(); ++v) {
    if (walk.root[v] == v && references.has_fixed[v] == 0) references.is_reference[v] = 1;
  }
  return references;
}

// Normal equations of averaging in blocks of 3 x 3, in the world's frame.
class NormalEquations {
 public:
  NormalEquations(const SupportGraph& graph,
                  std::span<const RelativeRotation> edges,
                  const std::vector<double>& weights,
                  const std::vector<Eigen::Matrix3d>& R_c_w,
                  const std::vector<char>& is_reference)
      : own_(graph.ids.size(), Eigen::Matrix3d::Zero()), slot_(graph.ids.size(), -1) {
    for (int v = 0; v < graph.size(); ++v) {
      if (is_reference[v] != 0) continue;
      slot_[v] = static_cast<int>(views_.size());
      views_.push_back(v);
    }
    for (std::size_t k = 0; k < edges.size(); ++k) {
      if (!(weights[k] > 0.0)) continue;
      const int i = graph.PositionOf(edges[k].i);
      const int j = graph.PositionOf(edges[k].j);
      const Eigen::Matrix3d& R = R_c_w[j];
      const Eigen::Matrix3d curvature =
          weights[k] * R.transpose() * edges[k].covariance.inverse() * R;
      own_[i] += curvature;
      own_[j] += curvature;
      if (slot_[i] >= 0 && slot_[j] >= 0) pairs_.push_back({slot_[i], slot_[j], curvature});
    }
    Order();
  }

  int num_free() const { return static_cast<int>(views_.size()); }
  // Sum of the curvatures of a view's edges.
  const Eigen::Matrix3d& OwnBlock(int view) const { return own_[view]; }
  // Row of blocks of a view in the order of elimination; -1 for a reference.
  int RowOf(int view) const { return slot_[view] < 0 ? -1 : position_[slot_[view]]; }

  // The pattern of the upper triangle of blocks in the order of elimination.
  Eigen::SparseMatrix<double> UpperPattern() const {
    return Pattern([&](int slot) { return position_[slot]; });
  }

  // The matrix's lower triangle in the order of elimination.
  Eigen::SparseMatrix<double> Matrix() const {
    BlockEntries entries;
    entries.reserve(9 * (views_.size() + pairs_.size()));
    for (int s = 0; s < num_free(); ++s) {
      AddBlock(position_[s], position_[s], own_[views_[s]], entries);
    }
    for (const auto& [i, j, curvature] : pairs_) {
      AddBlock(std::max(position_[i], position_[j]),
               std::min(position_[i], position_[j]),
               -curvature,
               entries);
    }
    Eigen::SparseMatrix<double> normal(3 * num_free(), 3 * num_free());
    normal.setFromTriplets(entries.begin(), entries.end());
    return normal;
  }

 private:
  struct Pair {
    int i, j;  // slots
    Eigen::Matrix3d curvature;
  };

  template <class Place>
  Eigen::SparseMatrix<double> Pattern(Place&& place) const {
    BlockEntries entries;
    for (int s = 0; s < num_free(); ++s) entries.emplace_back(place(s), place(s), 1.0);
    for (const Pair& pair : pairs_) {
      entries.emplace_back(
          std::min(place(pair.i), place(pair.j)), std::max(place(pair.i), place(pair.j)), 1.0);
    }
    Eigen::SparseMatrix<double> upper(num_free(), num_free());
    upper.setFromTriplets(entries.begin(), entries.end());
    return upper;
  }

  // An order with little fill.
  void Order() {
    Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
    const Eigen::SparseMatrix<double> lower = Pattern([](int slot) { return slot; }).transpose();
    if (num_free() > 0) Eigen::AMDOrdering<int>()(lower.selfadjointView<Eigen::Lower>(), order);
    position_.resize(views_.size());
    for (int k = 0; k < num_free(); ++k) position_[order.indices()[k]] = k;
  }

  std::vector<Eigen::Matrix3d> own_;  // by view
  std::vector<int> slot_;             // by view, -1: a reference
  std::vector<int> views_;            // by slot
  std::vector<Pair> pairs_;           // of free views
  std::vector<int> position_;         // by slot, in the order of elimination
};

// Blocks of the inverse of the normal equations, in the order of elimination.
struct InverseBlocks {
  std::vector<Eigen::Matrix3d> diagonal;
  Eigen::MatrixXd sums;  // covariances of the views with the sum of their component's errors
};

// nullopt where the equations have no inverse.
std::optional<InverseBlocks> Invert(const NormalEquations& equations) {
  const int num_free = equations.num_free();
  InverseBlocks inverse{{}, Eigen::MatrixXd::Zero(3 * num_free, 3)};
  if (num_free == 0) return inverse;
  const Eigen::
      SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower, Eigen::NaturalOrdering<int>>
          factor(equations.Matrix());
  if (factor.info() != Eigen::Success) return std::nullopt;
  inverse.diagonal = DiagonalBlocksOfInverse(factor.matrixL().nestedExpression(), factor.vectorD());
  Eigen::MatrixXd ones(3 * num_free, 3);
  for (int s = 0; s < num_free; ++s) ones.middleRows<3>(3 * s).setIdentity();
  inverse.sums = factor.solve(ones);
  return inverse;
}

// Covariance of every view's error, in the world's frame: relative to the fixed views, or to the
// mean of the component.
std::vector<Eigen::Matrix3d> CovariancesFrom(const InverseBlocks& inverse,
                                             const NormalEquations& equations,
                                             const GraphWalk& walk,
                                             const std::vector<char>& has_fixed) {
  const auto num_views = static_cast<int>(walk.root.size());
  std::vector<Eigen::Matrix3d> total(walk.root.size(), Eigen::Matrix3d::Zero());  // by root
  std::vector<double> count(walk.root.size(), 0.0);
  for (int v = 0; v < num_views; ++v) {
    const int root = walk.root[v];
    count[root] += 1.0;
    const int row = equations.RowOf(v);
    if (row >= 0) total[root] += inverse.sums.middleRows<3>(3 * row);
  }
  std::vector<Eigen::Matrix3d> covariances(walk.root.size(), Eigen::Matrix3d::Zero());
  for (int v = 0; v < num_views; ++v) {
    const int root = walk.root[v];
    const int row = equations.RowOf(v);
    Eigen::Matrix3d with_sum = Eigen::Matrix3d::Zero();
    if (row >= 0) {
      covariances[v] = inverse.diagonal[row];
      with_sum = inverse.sums.middleRows<3>(3 * row);
    }
    if (has_fixed[root] == 0) {
      covariances[v] += total[root] / (count[root] * count[root]) -
                        (with_sum + with_sum.transpose()) / count[root];
    }
  }
  return covariances;
}

}  // namespace

OrientationDeviations DeviationsOfViews(std::span<const RelativeRotation> edges,
                                        const std::vector<double>& weights,
                                        const RotationMap& cam_from_world,
                                        const std::set<FrameId>& held_views) {
  const SupportGraph graph =
      MakeSupportGraph(edges, [&](std::size_t k) { return weights[k] > 0.0; });
  std::vector<Eigen::Matrix3d> R_c_w;
  R_c_w.reserve(graph.ids.size());
  for (const FrameId id : graph.ids) R_c_w.push_back(cam_from_world.at(id).Matrix());
  const GraphWalk walk = WalkGraph(graph);
  const auto [is_reference, has_fixed] = FindReferences(graph, walk, held_views);
  const NormalEquations equations(graph, edges, weights, R_c_w, is_reference);

  OrientationDeviations deviations;
  const auto put = [&](int v, const Eigen::Matrix3d& in_world) {
    if (graph.neighbours[v].empty()) return;
    const Eigen::Matrix3d in_cam = R_c_w[v] * in_world * R_c_w[v].transpose();
    deviations.covariance[graph.ids[v]] = 0.5 * (in_cam + in_cam.transpose());
  };
  constexpr double kBlockProducts = 27.0;  // of 3 x 3 blocks per entry
  deviations.is_complete =
      CountFill(equations.UpperPattern(), kMaxDeviationProducts / kBlockProducts).is_complete;
  if (!deviations.is_complete) {
    for (int v = 0; v < graph.size(); ++v) {
      if (graph.neighbours[v].empty()) continue;
      const bool is_fixed = is_reference[v] != 0 && has_fixed[walk.root[v]] != 0;
      put(v,
          is_fixed ? Eigen::Matrix3d::Zero().eval()
                   : Eigen::Matrix3d(equations.OwnBlock(v).inverse()));
    }
    return deviations;
  }
  const std::optional<InverseBlocks> inverse = Invert(equations);
  if (!inverse) {
    deviations.is_complete = false;
    for (int v = 0; v < graph.size(); ++v) put(v, equations.OwnBlock(v).inverse());
    return deviations;
  }
  const std::vector<Eigen::Matrix3d> covariances =
      CovariancesFrom(*inverse, equations, walk, has_fixed);
  for (int v = 0; v < graph.size(); ++v) put(v, covariances[v]);
  return deviations;
}

}  // namespace rotslam
