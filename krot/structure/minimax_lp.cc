#include "krot/structure/minimax_lp.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Dense>

#include "krot/structure/structure_system.h"

namespace rotslam {
namespace {

// Weight of the slack in the feasibility program, whose unit is gamma. Weight and unit keep the
// optimum well above the engine's tolerance of 1e-7; with weight 1 and plain units a third of the
// programs near the optimum are undecided.
constexpr double kSlackPrice = 100.0;
double SlackUnit(double gamma) { return std::max(gamma, 1e-6); }

LinearProgram DualRows(const StructureLayout& rows) {
  LinearProgram program;
  for (int r = 0; r < rows.size(); ++r) program.AddRow(0.0, 0.0);
  return program;
}

// Upper bounds of the multipliers.
struct MultiplierBounds {
  std::vector<double> caps = {};  // by observation; empty: none
  double depth_price = 1.0;       // of the depth multiplier, in caps
  int budget_row = -1;            // row that bounds their sum; negative: none
};

// Adds the five multiplier columns of every observation.
void AddMultipliers(const MinimaxProblem& problem,
                    double gamma,
                    const StructureLayout& rows,
                    const MultiplierBounds& bounds,
                    LinearProgram& program) {
  const auto& [caps, depth_price, budget_row] = bounds;
  std::vector<std::pair<int, double>> entries;
  for (std::size_t o = 0; o < problem.observations.size(); ++o) {
    const ImageObservation& observation = problem.observations[o];
    const auto normals = HalfSpaceNormals(problem.R_c_w[observation.view], observation.xy, gamma);
    const double cap = caps.empty() ? kInfinity : caps[o];
    for (int k = 0; k < 5; ++k) {
      entries.clear();
      for (int axis = 0; axis < 3 && observation.view > 0; ++axis) {
        entries.emplace_back(rows.Center(observation.view) + axis, -normals[k][axis]);
      }
      for (int axis = 0; axis < 3; ++axis) {
        entries.emplace_back(rows.Point(observation.point) + axis, normals[k][axis]);
      }
      if (budget_row >= 0) entries.emplace_back(budget_row, k == 4 ? 1.0 : SlackUnit(gamma));
      program.AddColumn(k == 4 ? -1.0 : 0.0, 0.0, k == 4 ? depth_price * cap : cap, entries);
    }
  }
}

// Centres and points are the multipliers of the dual's rows. With min -sum w, stationarity of the
// Lagrangian gives multipliers equal to minus the unknowns.
MinimaxLpResult FromDual(const LpResult& lp, const StructureLayout& rows) {
  MinimaxLpResult result;
  result.call = lp.call;
  result.model = lp.model;
  result.iterations = lp.iterations;
  result.seconds = lp.seconds;
  if (lp.call != LpCallStatus::kCompleted) return result;
  result.objective = -lp.objective;
  result.multipliers = lp.primal;
  const auto unknown = [&](int row) {
    return Eigen::Vector3d(lp.row_dual[row], lp.row_dual[row + 1], lp.row_dual[row + 2]);
  };
  result.structure.center_in_world.assign(rows.num_views, Eigen::Vector3d::Zero());
  for (int view = 1; view < rows.num_views; ++view) {
    result.structure.center_in_world[view] = unknown(rows.Center(view));
  }
  for (int point = 0; point < rows.num_points; ++point) {
    result.structure.point_in_world.push_back(unknown(rows.Point(point)));
  }
  return result;
}

using NormalTable = std::vector<std::array<Eigen::Vector3d, 5>>;

// Compensated sums (Neumaier): their error is a few units in the last place of the largest term for
// any number of terms.
class CompensatedSums {
 public:
  explicit CompensatedSums(int size)
      : sum_(Eigen::VectorXd::Zero(size)), lost_(Eigen::VectorXd::Zero(size)) {}

  void Add(int row, const Eigen::Vector3d& term) {
    for (int axis = 0; axis < 3; ++axis) {
      double& sum = sum_[row + axis];
      const double next = sum + term[axis];
      lost_[row + axis] += std::abs(sum) >= std::abs(term[axis]) ? (sum - next) + term[axis]
                                                                 : (term[axis] - next) + sum;
      sum = next;
    }
  }
  Eigen::VectorXd Total() const { return sum_ + lost_; }

 private:
  Eigen::VectorXd sum_;
  Eigen::VectorXd lost_;
};

// Residual sums e = sum_k y_k a_k of every centre and point, with a bound of their rounding.
struct Imbalance {
  Eigen::VectorXd sum;
  double absolute_sum = 0.0;  // of the absolute values of all terms
  double num_terms = 0.0;

  // Upper bound of the 1-norm of the exact sums. Every term has up to eight roundings from the
  // normal and the product; the compensated sum of n terms adds two and n^2 epsilon.
  double Bound() const {
    constexpr double kEpsilon = 2.3e-16;
    const double of_sums = 4.0 + kEpsilon * num_terms * num_terms;
    return sum.lpNorm<1>() * (1.0 + 4.0 * kEpsilon * static_cast<double>(sum.size())) +
           kEpsilon * absolute_sum * (8.0 + of_sums);
  }
};

Imbalance ComputeImbalance(const MinimaxProblem& problem,
                           const NormalTable& normals,
                           const StructureLayout& rows,
                           const std::vector<double>& y) {
  CompensatedSums sums(rows.size());
  Imbalance imbalance;
  for (std::size_t o = 0; o < normals.size(); ++o) {
    const ImageObservation& observation = problem.observations[o];
    for (int k = 0; k < 5; ++k) {
      const Eigen::Vector3d term = y[5 * o + k] * normals[o][k];
      sums.Add(rows.Point(observation.point), term);
      imbalance.absolute_sum += 2.0 * term.lpNorm<1>();
      if (observation.view > 0) sums.Add(rows.Center(observation.view), -term);
    }
  }
  imbalance.sum = sums.Total();
  imbalance.num_terms = 5.0 * static_cast<double>(normals.size());
  return imbalance;
}

// One step y += -D E^T (E D E^T)^-1 e with D = diag(y): every multiplier changes in proportion to
// its size and stays positive. (D = diag(y^2) has twice the range of magnitudes and ends at 1e-8
// instead of 1e-14.)
bool RepairStep(const MinimaxProblem& problem,
                const NormalTable& normals,
                const Eigen::VectorXd& imbalance,
                StructureSystem& system,
                std::vector<double>& y) {
  std::vector<Eigen::Matrix3d> S(normals.size(), Eigen::Matrix3d::Zero());
  for (std::size_t o = 0; o < normals.size(); ++o) {
    for (int k = 0; k < 5; ++k) {
      S[o] += y[5 * o + k] * normals[o][k] * normals[o][k].transpose();
    }
  }
  if (!system.Factor(S)) return false;
  const StructureLayout rows{problem.num_views(), problem.num_points};
  const Eigen::VectorXd lambda = system.Solve(S, imbalance);
  if (!lambda.allFinite()) return false;
  for (std::size_t o = 0; o < normals.size(); ++o) {
    const ImageObservation& observation = problem.observations[o];
    Eigen::Vector3d difference = lambda.segment<3>(rows.Point(observation.point));
    if (observation.view > 0) difference -= lambda.segment<3>(rows.Center(observation.view));
    for (int k = 0; k < 5; ++k) {
      double& multiplier = y[5 * o + k];
      multiplier = std::max(0.0, multiplier - multiplier * normals[o][k].dot(difference));
    }
  }
  return true;
}

}  // namespace

void RequireProgram(const MinimaxProblem& problem, double gamma) {
  CheckProblem(problem);
  if (problem.num_views() < 2 || problem.num_points < 1 || problem.observations.empty()) {
    throw std::invalid_argument("minimax problem: needs two views, a point and an observation");
  }
  if (!(gamma >= 0.0) || !std::isfinite(gamma)) {
    throw std::invalid_argument("minimax problem: gamma must be finite and not negative");
  }
}

std::array<Eigen::Vector3d, 5> HalfSpaceNormals(const Eigen::Matrix3d& R_c_w,
                                                const Eigen::Vector2d& xy,
                                                double gamma) {
  const Eigen::Vector3d r1 = R_c_w.row(0);
  const Eigen::Vector3d r2 = R_c_w.row(1);
  const Eigen::Vector3d r3 = R_c_w.row(2);
  return {r1 - (xy.x() + gamma) * r3,
          -r1 + (xy.x() - gamma) * r3,
          r2 - (xy.y() + gamma) * r3,
          -r2 + (xy.y() - gamma) * r3,
          -r3};
}

MinimaxLpResult SolveFeasibility(const MinimaxProblem& problem,
                                 double gamma,
                                 const LpOptions& options) {
  RequireProgram(problem, gamma);
  const StructureLayout rows{problem.num_views(), problem.num_points};
  LinearProgram program = DualRows(rows);
  const int budget_row = program.num_rows();
  program.AddRow(-kInfinity, kSlackPrice);
  AddMultipliers(problem, gamma, rows, {.budget_row = budget_row}, program);
  return FromDual(SolveLp(program, options), rows);
}

void RequireL1Program(const L1SlackProgram& program) {
  RequireProgram(program.problem, program.gamma);
  if (!program.weights.empty() && program.weights.size() != program.problem.observations.size()) {
    throw std::invalid_argument("L1 slack program: one weight per observation expected");
  }
}

MinimaxLpResult SolveL1Slack(const L1SlackProgram& l1, const LpOptions& options) {
  RequireL1Program(l1);
  const MinimaxProblem& problem = l1.problem;
  MultiplierBounds bounds;
  bounds.caps = l1.weights;
  if (bounds.caps.empty()) bounds.caps.assign(problem.observations.size(), 1.0);
  bounds.depth_price = l1.depth_price;
  const StructureLayout rows{problem.num_views(), problem.num_points};
  LinearProgram program = DualRows(rows);
  AddMultipliers(problem, l1.gamma, rows, bounds, program);
  return FromDual(SolveLp(program, options), rows);
}

bool CertifiesInfeasible(const MinimaxProblem& problem,
                         double gamma,
                         std::vector<double> y,
                         double max_extent) {
  if (y.size() != 5 * problem.observations.size()) return false;
  double largest = 0.0;
  for (double& multiplier : y) {
    if (!std::isfinite(multiplier)) return false;
    multiplier = std::max(0.0, multiplier);
    largest = std::max(largest, multiplier);
  }
  if (largest == 0.0) return false;
  for (double& multiplier : y) multiplier /= largest;
  const StructureLayout rows{problem.num_views(), problem.num_points};
  StructureSystem system(problem);
  NormalTable normals;
  normals.reserve(problem.observations.size());
  for (const ImageObservation& observation : problem.observations) {
    normals.push_back(HalfSpaceNormals(problem.R_c_w[observation.view], observation.xy, gamma));
  }
  // If x were feasible with |x|_inf <= max_extent, then
  //   sum w = -b^T y <= -(E y)^T x <= max_extent * |E y|_1.
  constexpr int kMaxRepairs = 6;
  for (int round = 0;; ++round) {
    const Imbalance imbalance = ComputeImbalance(problem, normals, rows, y);
    double depth_sum = 0.0;
    for (std::size_t o = 0; o < normals.size(); ++o) depth_sum += y[5 * o + 4];
    if (depth_sum > 2.0 * max_extent * imbalance.Bound()) return true;
    if (round == kMaxRepairs) return false;
    if (!RepairStep(problem, normals, imbalance.sum, system, y)) return false;
  }
}

}  // namespace rotslam
