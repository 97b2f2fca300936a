#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "rotodom/averaging/laplacian_solver.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

enum class EdgeLoss {
  kL1,            // convex: the influence of a wrong edge does not grow with its error
  kGemanMcClure,  // redescending: the influence of a wrong edge vanishes
};

/// Robust least squares over relative rotations, linearised at the present orientations.
///
/// The unknowns are small rotations of the cameras in the world's frame, cam_from_world *
/// Exp(turn). The residual of an edge is then r + turn_j - turn_i, and the normal equations are the
/// weighted Laplacian of the graph: a step costs a few additions per edge and one solution of it,
/// by dense Cholesky factorisation for few free orientations and by LaplacianSolver for many.
class EdgeSystem {
 public:
  /// An edge between two positions in the list of orientations, in the world's frame.
  struct Term {
    int i = 0;
    int j = 0;
    Eigen::Quaterniond i_from_j;       // measured
    Eigen::Matrix3d information_in_j;  // inverse covariance in the frame of camera j
    Eigen::Matrix3d information;       // the same in the world's frame
    Eigen::Vector3d residual;          // Log(predicted * measured^-1), in the world's frame
    double squared_scale = 1.0;        // of the robust loss
    double weight = 1.0;               // of the robust loss
    Eigen::Matrix3d curvature;         // of the loss, what the edge adds to the normal equations
  };

  /// @param cam_from_world  orientations; the first `num_free` are unknowns, the others are fixed.
  /// @param loss_sigmas     scale of the Geman-McClure loss, in standard deviations.
  /// @param num_threads     used for large systems; the result does not depend on it.
  EdgeSystem(std::vector<Eigen::Quaterniond> cam_from_world,
             int num_free,
             double loss_sigmas,
             int num_threads = 1);

  void Reserve(std::size_t num_edges) { terms_.reserve(num_edges); }
  /// Adds an edge between positions i and j, at least one of them free; `covariance` of the error
  /// delta in `Exp(delta) * j_from_i`.
  void AddEdge(int i, int j, const Rotation& j_from_i, const Eigen::Matrix3d& covariance);

  /// One re-weighted Gauss-Newton step. Returns the largest change of an orientation in radians, or
  /// a negative number when the equations have no finite solution; the orientations are then
  /// unchanged.
  double Step(EdgeLoss loss = EdgeLoss::kGemanMcClure);

  /// Sets the scale of the loss for one edge, numbered in the order of AddEdge. Larger scales let
  /// edges correct a wrong start.
  void SetLossSigmas(int edge, double loss_sigmas) {
    terms_[edge].squared_scale = loss_sigmas * loss_sigmas;
  }

  /// Number of free views for which most edges contradict the present orientations: their residuals
  /// exceed the scale of the loss. Call after `Step` or `Linearize`.
  int CountInconsistentViews() const;

  /// Change in the last step that at most this share of the free views exceeded, among views with
  /// an edge that agrees. Views with wrong edges only may go on changing for long.
  double AgreedTurn(double exceeding_share) const;

  /// Residuals and weights at the present orientations.
  void Linearize(EdgeLoss loss = EdgeLoss::kGemanMcClure);

  const std::vector<Term>& terms() const { return terms_; }
  int num_free() const { return num_free_; }
  /// Orientations with all steps applied.
  Rotation CamFromWorld(int view) const;
  /// Normal equations at the last `Linearize`, lower triangle, 3 num_free square.
  Eigen::MatrixXd DenseNormalMatrix() const;

 private:
  void LinearizeTerm(Term& term) const;
  void LinearizeTerms();
  // Returns information times residual.
  Eigen::Vector3d ReweightTerm(Term& term, EdgeLoss loss) const;
  void Reweight(EdgeLoss loss);
  bool SolveDense();
  bool SolveSparse();

  int num_free_;
  double squared_scale_;
  int num_threads_;
  std::vector<Eigen::Quaterniond> cam_from_world_;
  std::vector<Eigen::Matrix3d> R_c_w_;
  std::vector<Term> terms_;
  Eigen::VectorXd turns_;  // since the last Linearize
  Eigen::VectorXd step_;   // gradient, then solution
  Eigen::MatrixXd dense_;
  std::unique_ptr<LaplacianSolver> solver_;
  std::vector<LaplacianEdge> laplacian_;
  double last_turn_;
};

}  // namespace rotslam
