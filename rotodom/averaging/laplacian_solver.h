#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

namespace rotslam {

/// An edge of a weighted graph Laplacian with blocks of 3x3.
struct LaplacianEdge {
  int i = 0;
  int j = 0;
  Eigen::Matrix3d curvature = Eigen::Matrix3d::Zero();  // positive semi-definite
  bool is_structural = true;  // false: its weight is too small to be part of the factorisation
};

/// Solves the normal equations of rotation averaging: sparse systems whose matrix is the Laplacian
/// of the graph with 3x3 blocks `curvature`, plus a small multiple of the identity.
///
/// Conjugate gradients are preconditioned by a Cholesky factorisation of the scalar Laplacian with
/// a third of the curvatures' traces as weights. It has nine times fewer entries than the block
/// matrix, and is the exact inverse where all curvatures are isotropic. The elimination order is
/// kept while the structural edges do not change, and the factorisation while the number of
/// iterations stays small. Where the factor would fill in (random edges across a large graph) the
/// diagonal blocks are the preconditioner; such graphs need few iterations.
/// The factorisation is Eigen's. CHOLMOD's simplicial one takes as long; its supernodal one, under
/// the GPL, takes half as long from some 100,000 views on (tests/bench/cholesky_bench.cc).
class LaplacianSolver {
 public:
  /// Positions below `num_free` are unknown; the solution at the others is zero.
  explicit LaplacianSolver(int num_free);

  /// Solves for the right-hand side `x` of 3 num_free numbers, and replaces it by the solution.
  /// @param damping  share of the largest pivot added to all.
  /// @return  false when there is no finite solution.
  /// Error:   relative residual 1e-4, in the norm of the preconditioner.
  /// Cost:    a factorisation now and then, and one to some twenty products with the matrix.
  bool Solve(std::span<const LaplacianEdge> edges, double damping, Eigen::VectorXd& x);

 private:
  using Factor =
      Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Upper, Eigen::NaturalOrdering<int>>;

  bool HasNewStructure(std::span<const LaplacianEdge> edges) const;
  void Analyze(std::span<const LaplacianEdge> edges);
  bool Factorize(std::span<const LaplacianEdge> edges);
  static bool FillIsAffordable(const Eigen::SparseMatrix<double>& upper, std::size_t num_edges);
  void SetDiagonal(std::span<const LaplacianEdge> edges, double damping);
  void Multiply(std::span<const LaplacianEdge> edges,
                const Eigen::VectorXd& x,
                Eigen::VectorXd& product) const;
  void Precondition(const Eigen::VectorXd& residual, Eigen::VectorXd& result);

  int num_free_;
  bool is_analyzed_ = false;
  bool is_factorized_ = false;
  bool uses_factor_ = false;
  int last_iterations_ = 0;
  double damping_ = 0.0;
  std::vector<int> position_;        // of a view in the order of elimination
  std::vector<int> diagonal_place_;  // among the values of upper_, by view
  std::vector<int> edge_place_;      // by edge, -1 for those outside
  Eigen::SparseMatrix<double> upper_;
  Factor factor_;
  std::vector<Eigen::Matrix3d> diagonal_inverse_;
  Eigen::Matrix<double, 3, Eigen::Dynamic> permuted_;
};

}  // namespace rotslam
