#pragma once

#include <array>
#include <optional>
#include <vector>

#include "krot/lp/lp.h"
#include "krot/structure/minimax_problem.h"

namespace rotslam {

// The linear programs of the known-rotation problem, all in dual form: the normal matrix A D A^T of
// the dual has bundle adjustment's block structure, that of the primal with its slack column does
// not, and an interior-point method pays for exactly that matrix.
//
// For an image bound gamma, each observation (u, v) of point X in the view (r1, r2, r3; c) gives
// five half-spaces a_k . (X - c) <= b_k:
//   right, left   +-(r1 - u r3) - gamma r3,  b = 0
//   below, above  +-(r2 - v r3) - gamma r3,  b = 0
//   depth         -r3,                       b = -1    (fixes the scale: smallest depth one)

/// Throws std::invalid_argument where there is no such program: a problem that CheckProblem refuses
/// or without two views, a point and an observation, a gamma that is negative or not finite.
void RequireProgram(const MinimaxProblem& problem, double gamma);

/// Normals a_0 .. a_4 of one observation, in world axes.
std::array<Eigen::Vector3d, 5> HalfSpaceNormals(const Eigen::Matrix3d& R_c_w,
                                                const Eigen::Vector2d& xy,
                                                double gamma);

/// What one program gave.
struct MinimaxLpResult {
  LpCallStatus call = LpCallStatus::kNotRun;
  LpModelStatus model = LpModelStatus::kUnknown;
  MinimaxStructure structure;       // empty when the call failed
  std::vector<double> multipliers;  // 5 per observation, >= 0: the half-spaces' prices
  double objective = 0.0;
  int iterations = 0;
  double seconds = 0.0;
};

/// min s  s.t.  a_k . (X - c) <= b_k + s gamma (k < 4),  <= b_k + s (depth),  s >= 0: is there a
/// structure with all residuals at most `gamma`? Zero objective says yes (recompute MaxBoxResidual
/// of the structure), a positive one no (check the multipliers with CertifiesInfeasible).
MinimaxLpResult SolveFeasibility(const MinimaxProblem& problem,
                                 double gamma,
                                 const LpOptions& options = {});

/// min sum of the slacks by which half-spaces are missed, a slack of the depth bound counted
/// `depth_price` times: the robust start. Outliers buy their slack, inliers pay none.
/// @param weights  price of each observation's slack, positive; empty: all one.
MinimaxLpResult SolveL1Slack(const MinimaxProblem& problem,
                             double gamma,
                             double depth_price,
                             const std::vector<double>& weights = {},
                             const LpOptions& options = {});

/// Lower bounds exclude structures up to this many times their smallest depth, as large as a
/// kilometre to a millimetre.
inline constexpr double kMaxExtent = 1e6;

/// True when `multipliers` prove, in plain double arithmetic with its rounding counted, that no
/// structure has all residuals at most `gamma` and all depths positive. Independent of the LP
/// engine: the multipliers are first repaired by weighted least squares onto
/// sum_k y_k a_k = 0 for every point and every centre but the first, then
/// sum of depth multipliers > max_extent * (what is left of those sums) must hold.
/// @param max_extent  structures larger than this many smallest depths are not excluded.
bool CertifiesInfeasible(const MinimaxProblem& problem,
                         double gamma,
                         std::vector<double> multipliers,
                         double max_extent);

}  // namespace rotslam
