#include "rotodom/averaging/laplacian_solver.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>
#include <Eigen/OrderingMethods>

#include "rotodom/averaging/fill.h"

namespace rotslam {
namespace {

constexpr double kTolerance = 1e-4;  // relative residual: Gauss-Newton corrects the rest
constexpr int kMaxIterations = 300;  // of conjugate gradients
// Iterations above which the matrix is factorised again: on graphs of streets a factorisation costs
// about as many products.
constexpr int kStaleIterations = 12;
// Multiplications per edge, and in all, up to which a factorisation is cheaper than the iterations
// that it saves.
constexpr double kMaxProductsPerEdge = 2e4;
constexpr double kAlwaysAffordable = 1e7;

double ScalarWeight(const LaplacianEdge& edge) { return edge.curvature.trace() / 3.0; }

}  // namespace

LaplacianSolver::LaplacianSolver(int num_free) : num_free_(num_free), permuted_(3, num_free) {}

bool LaplacianSolver::HasNewStructure(std::span<const LaplacianEdge> edges) const {
  if (!is_analyzed_ || edge_place_.size() != edges.size()) return true;
  if (!uses_factor_) return false;
  for (std::size_t k = 0; k < edges.size(); ++k) {
    const bool is_inner = std::max(edges[k].i, edges[k].j) < num_free_;
    if (is_inner && edges[k].is_structural && edge_place_[k] < 0) return true;
  }
  return false;
}

void LaplacianSolver::Analyze(std::span<const LaplacianEdge> edges) {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(edges.size() + static_cast<std::size_t>(num_free_));
  for (int view = 0; view < num_free_; ++view) entries.emplace_back(view, view, 1.0);
  for (const LaplacianEdge& edge : edges) {
    if (!edge.is_structural || std::max(edge.i, edge.j) >= num_free_) continue;
    entries.emplace_back(std::max(edge.i, edge.j), std::min(edge.i, edge.j), 1.0);
  }
  Eigen::SparseMatrix<double> lower(num_free_, num_free_);
  lower.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(lower.selfadjointView<Eigen::Lower>(), order);
  position_.resize(static_cast<std::size_t>(num_free_));
  for (int k = 0; k < num_free_; ++k) position_[order.indices()[k]] = k;

  for (Eigen::Triplet<double>& entry : entries) {
    const int a = position_[entry.row()];
    const int b = position_[entry.col()];
    entry = Eigen::Triplet<double>(std::min(a, b), std::max(a, b), 1.0);
  }
  upper_.resize(num_free_, num_free_);
  upper_.setFromTriplets(entries.begin(), entries.end());
  is_analyzed_ = true;
  uses_factor_ = FillIsAffordable(upper_, edges.size());
  edge_place_.assign(edges.size(), -1);
  if (!uses_factor_) return;

  const auto place = [&](int a, int b) {
    const int row = std::min(position_[a], position_[b]);
    const int column = std::max(position_[a], position_[b]);
    const int* begin = upper_.innerIndexPtr() + upper_.outerIndexPtr()[column];
    const int* end = upper_.innerIndexPtr() + upper_.outerIndexPtr()[column + 1];
    return static_cast<int>(std::lower_bound(begin, end, row) - upper_.innerIndexPtr());
  };
  diagonal_place_.resize(static_cast<std::size_t>(num_free_));
  for (int view = 0; view < num_free_; ++view) diagonal_place_[view] = place(view, view);
  for (std::size_t k = 0; k < edges.size(); ++k) {
    if (!edges[k].is_structural || std::max(edges[k].i, edges[k].j) >= num_free_) continue;
    edge_place_[k] = place(edges[k].i, edges[k].j);
  }
  factor_.analyzePattern(upper_);
}

bool LaplacianSolver::FillIsAffordable(const Eigen::SparseMatrix<double>& upper,
                                       std::size_t num_edges) {
  const double limit =
      std::max(kAlwaysAffordable, kMaxProductsPerEdge * static_cast<double>(num_edges));
  return CountFill(upper, limit).is_complete;
}

bool LaplacianSolver::Factorize(std::span<const LaplacianEdge> edges) {
  double* values = upper_.valuePtr();
  std::fill_n(values, upper_.nonZeros(), 0.0);
  for (int view = 0; view < num_free_; ++view) values[diagonal_place_[view]] = damping_;
  for (std::size_t k = 0; k < edges.size(); ++k) {
    const double weight = ScalarWeight(edges[k]);
    if (edges[k].i < num_free_) values[diagonal_place_[edges[k].i]] += weight;
    if (edges[k].j < num_free_) values[diagonal_place_[edges[k].j]] += weight;
    if (edge_place_[k] >= 0) values[edge_place_[k]] -= weight;
  }
  factor_.factorize(upper_);
  return factor_.info() == Eigen::Success;
}

void LaplacianSolver::SetDiagonal(std::span<const LaplacianEdge> edges, double damping) {
  std::vector<Eigen::Matrix3d>& blocks = diagonal_inverse_;
  blocks.assign(static_cast<std::size_t>(num_free_), Eigen::Matrix3d::Zero());
  for (const LaplacianEdge& edge : edges) {
    if (edge.i < num_free_) blocks[edge.i] += edge.curvature;
    if (edge.j < num_free_) blocks[edge.j] += edge.curvature;
  }
  double largest = 0.0;
  for (const Eigen::Matrix3d& block : blocks) {
    largest = std::max(largest, block.diagonal().maxCoeff());
  }
  damping_ = damping * largest;
  if (uses_factor_) return;
  for (Eigen::Matrix3d& block : blocks) {
    block = (block + damping_ * Eigen::Matrix3d::Identity()).inverse().eval();
  }
}

void LaplacianSolver::Multiply(std::span<const LaplacianEdge> edges,
                               const Eigen::VectorXd& x,
                               Eigen::VectorXd& product) const {
  product = damping_ * x;
  for (const LaplacianEdge& edge : edges) {
    Eigen::Vector3d difference = Eigen::Vector3d::Zero();
    if (edge.j < num_free_) difference += x.segment<3>(3 * edge.j);
    if (edge.i < num_free_) difference -= x.segment<3>(3 * edge.i);
    const Eigen::Vector3d pull = edge.curvature * difference;
    if (edge.j < num_free_) product.segment<3>(3 * edge.j) += pull;
    if (edge.i < num_free_) product.segment<3>(3 * edge.i) -= pull;
  }
}

void LaplacianSolver::Precondition(const Eigen::VectorXd& residual, Eigen::VectorXd& result) {
  if (!uses_factor_) {
    for (int view = 0; view < num_free_; ++view) {
      result.segment<3>(3 * view) = diagonal_inverse_[view] * residual.segment<3>(3 * view);
    }
    return;
  }
  for (int view = 0; view < num_free_; ++view) {
    permuted_.col(position_[view]) = residual.segment<3>(3 * view);
  }
  // All three right sides in one pass over the factor.
  const auto& L = factor_.matrixL().nestedExpression();
  const int* outer = L.outerIndexPtr();
  const int* inner = L.innerIndexPtr();
  const double* values = L.valuePtr();
  for (int column = 0; column < num_free_; ++column) {
    const Eigen::Vector3d x = permuted_.col(column);
    for (int p = outer[column]; p < outer[column + 1]; ++p) {
      permuted_.col(inner[p]) -= values[p] * x;
    }
  }
  const auto& D = factor_.vectorD();
  for (int column = num_free_ - 1; column >= 0; --column) {
    Eigen::Vector3d x = permuted_.col(column) / D[column];
    for (int p = outer[column]; p < outer[column + 1]; ++p) {
      x -= values[p] * permuted_.col(inner[p]);
    }
    permuted_.col(column) = x;
  }
  for (int view = 0; view < num_free_; ++view) {
    result.segment<3>(3 * view) = permuted_.col(position_[view]);
  }
}

bool LaplacianSolver::Solve(std::span<const LaplacianEdge> edges,
                            double damping,
                            Eigen::VectorXd& x) {
  if (HasNewStructure(edges)) {
    Analyze(edges);
    is_factorized_ = false;
  }
  SetDiagonal(edges, damping);
  if (!std::isfinite(damping_) || !x.allFinite()) return false;
  if (uses_factor_ && (!is_factorized_ || last_iterations_ > kStaleIterations)) {
    is_factorized_ = Factorize(edges);
    if (!is_factorized_) return false;
  }
  Eigen::VectorXd residual = x;
  Eigen::VectorXd preconditioned(x.size());
  Eigen::VectorXd product(x.size());
  x.setZero();
  Precondition(residual, preconditioned);
  Eigen::VectorXd direction = preconditioned;
  double squared = residual.dot(preconditioned);
  const double goal = kTolerance * kTolerance * squared;
  last_iterations_ = 0;
  while (squared > goal && last_iterations_ < kMaxIterations) {
    ++last_iterations_;
    Multiply(edges, direction, product);
    const double step = squared / direction.dot(product);
    if (!std::isfinite(step)) return false;
    x += step * direction;
    residual -= step * product;
    Precondition(residual, preconditioned);
    const double next = residual.dot(preconditioned);
    direction = preconditioned + (next / squared) * direction;
    squared = next;
  }
  return x.allFinite();
}

}  // namespace rotslam
