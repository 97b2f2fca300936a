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

/// Throws std::invalid_argument where the program is not defined: for a problem that CheckProblem
/// rejects or that lacks two views, a point and an observation, and for a gamma that is negative or
/// not finite.
void RequireProgram(const MinimaxProblem& problem, double gamma);

/// Normals a_0 .. a_4 of one observation, in world axes.
std::array<Eigen::Vector3d, 5> HalfSpaceNormals(const Eigen::Matrix3d& R_c_w,
                                                const Eigen::Vector2d& xy,
                                                double gamma);

/// The result of a linear program.
struct MinimaxLpResult {
  LpCallStatus call = LpCallStatus::kNotRun;
  LpModelStatus model = LpModelStatus::kUnknown;
  MinimaxStructure structure;       // empty when the call failed
  std::vector<double> multipliers;  // 5 per observation, >= 0: of the half-spaces
  double objective = 0.0;
  int iterations = 0;
  double seconds = 0.0;
};

/// Feasibility program: min s  s.t.  a_k . (X - c) <= b_k + s gamma (k < 4),  <= b_k + s (depth),
/// s >= 0. An objective of zero means that a structure with all residuals at most `gamma` exists
/// (verify with MaxBoxResidual), a positive one that there is none (verify the multipliers with
/// CertifiesInfeasible).
MinimaxLpResult SolveFeasibility(const MinimaxProblem& problem,
                                 double gamma,
                                 const LpOptions& options = {});

/// L1 program for the robust start: the minimum of the sum of slacks of the half-spaces. Only
/// outliers have slack.
struct L1SlackProgram {
  const MinimaxProblem& problem;
  double gamma = 0.0;                // image bound, normalised
  double depth_price = 1.0;          // weight of the slack of depth bounds
  std::vector<double> weights = {};  // of each observation's slack, positive; empty: all one
};

/// Throws std::invalid_argument where RequireProgram does, and unless there is one weight per
/// observation or none.
void RequireL1Program(const L1SlackProgram& program);

MinimaxLpResult SolveL1Slack(const L1SlackProgram& program, const LpOptions& options = {});

/// Lower bounds exclude structures up to this many times their smallest depth, as large as a
/// kilometre to a millimetre.
inline constexpr double kMaxExtent = 1e6;

/// True when `multipliers` prove, in double arithmetic with bounds on its rounding, that no
/// structure has all residuals at most `gamma` and all depths positive. The proof does not depend
/// on the LP engine: the multipliers are first corrected by weighted least squares so that sum_k
/// y_k a_k = 0 for every point and every centre but the first. Then sum of depth multipliers >
/// max_extent * (remainder of those sums) must hold.
/// @param max_extent  structures larger than this many smallest depths are not excluded.
bool CertifiesInfeasible(const MinimaxProblem& problem,
                         double gamma,
                         std::vector<double> multipliers,
                         double max_extent);

}  // namespace rotslam
