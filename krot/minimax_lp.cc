#include "krot/minimax_lp.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Dense>

namespace rotslam {
namespace {

// The feasibility program counts its slack in units of gamma, and a unit of it costs this much. One
// and the other lift the optimum well above the engine's tolerance (1e-7): with plain units and
// price 1 a third of the programs near the optimum came back undecided, with these one in fifty.
constexpr double kSlackPrice = 100.0;
double SlackUnit(double gamma) { return std::max(gamma, 1e-6); }

// Rows of the dual: three per centre (all but the first), then three per point.
struct RowLayout {
  int num_views;
  int num_points;
  int Center(int view) const { return 3 * (view - 1); }  // negative for the gauge view
  int Point(int point) const { return 3 * (num_views - 1) + 3 * point; }
  int size() const { return 3 * (num_views - 1) + 3 * num_points; }
};

LinearProgram DualRows(const RowLayout& rows) {
  LinearProgram program;
  for (int r = 0; r < rows.size(); ++r) program.AddRow(0.0, 0.0);
  return program;
}

// Adds the five multiplier columns of every observation, bounded by its cap (empty: unbounded) and
// the depth multiplier by `depth_price` caps. `budget_row` < 0: no shared budget.
void AddMultipliers(const MinimaxProblem& problem,
                    double gamma,
                    const RowLayout& rows,
                    int budget_row,
                    const std::vector<double>& caps,
                    double depth_price,
                    LinearProgram& program) {
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

// Centres and points are the prices of the dual's rows. With min -sum w, Lagrangian stationarity
// gives row prices equal to minus the unknowns.
MinimaxLpResult FromDual(const LpResult& lp, const RowLayout& rows) {
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

void RequireUsable(const MinimaxProblem& problem, double gamma) {
  CheckProblem(problem);
  if (problem.num_views() < 2 || problem.num_points < 1 || problem.observations.empty()) {
    throw std::invalid_argument("minimax problem: needs two views, a point and an observation");
  }
  if (!(gamma >= 0.0) || !std::isfinite(gamma)) {
    throw std::invalid_argument("minimax problem: gamma must be finite and not negative");
  }
}

// Residual sums e = sum_k y_k a_k of every centre and point, with what bounds their rounding: the
// sums of absolute values and the number of terms.
struct Imbalance {
  Eigen::VectorXd sum;
  Eigen::VectorXd absolute_sum;
  Eigen::VectorXd terms;

  // Largest 1-norm the exact sums can have. A sum of n rounded terms errs by less than
  // n * epsilon * (sum of absolute values); a normal's entry carries five roundings itself.
  double Bound() const {
    constexpr double kEpsilon = 2.3e-16;
    return sum.lpNorm<1>() + kEpsilon * absolute_sum.dot((terms.array() + 8.0).matrix());
  }
};

using NormalTable = std::vector<std::array<Eigen::Vector3d, 5>>;

Imbalance ComputeImbalance(const MinimaxProblem& problem,
                           const NormalTable& normals,
                           const RowLayout& rows,
                           const std::vector<double>& y) {
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(rows.size());
  Imbalance imbalance{zero, zero, zero};
  for (std::size_t o = 0; o < normals.size(); ++o) {
    const ImageObservation& observation = problem.observations[o];
    imbalance.terms.segment<3>(rows.Point(observation.point)).array() += 5.0;
    if (observation.view > 0) {
      imbalance.terms.segment<3>(rows.Center(observation.view)).array() += 5.0;
    }
    for (int k = 0; k < 5; ++k) {
      const Eigen::Vector3d term = y[5 * o + k] * normals[o][k];
      imbalance.sum.segment<3>(rows.Point(observation.point)) += term;
      imbalance.absolute_sum.segment<3>(rows.Point(observation.point)) += term.cwiseAbs();
      if (observation.view == 0) continue;
      imbalance.sum.segment<3>(rows.Center(observation.view)) -= term;
      imbalance.absolute_sum.segment<3>(rows.Center(observation.view)) += term.cwiseAbs();
    }
  }
  return imbalance;
}

// One step y += -D E^T (E D E^T)^-1 e with D = diag(y): every multiplier moves by a share of itself
// and stays positive. (D = diag(y^2) spans twice the digits and left imbalances of 1e-8 where this
// reaches 1e-14.) E D E^T is eliminated point by point, as in bundle adjustment.
bool RepairStep(const MinimaxProblem& problem,
                const NormalTable& normals,
                const RowLayout& rows,
                const Eigen::VectorXd& imbalance,
                std::vector<double>& y) {
  const int num_center_rows = 3 * (rows.num_views - 1);
  std::vector<Eigen::Matrix3d> S(normals.size(), Eigen::Matrix3d::Zero());
  std::vector<Eigen::Matrix3d> H_point(rows.num_points, Eigen::Matrix3d::Zero());
  std::vector<std::vector<int>> observations_of(rows.num_points);
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(num_center_rows, num_center_rows);
  Eigen::VectorXd g = imbalance.head(num_center_rows);
  for (std::size_t o = 0; o < normals.size(); ++o) {
    const ImageObservation& observation = problem.observations[o];
    for (int k = 0; k < 5; ++k) {
      S[o] += y[5 * o + k] * normals[o][k] * normals[o][k].transpose();
    }
    H_point[observation.point] += S[o];
    observations_of[observation.point].push_back(static_cast<int>(o));
    if (observation.view == 0) continue;
    const int row = rows.Center(observation.view);
    H.block<3, 3>(row, row) += S[o];
  }
  double largest_trace = 0.0;
  for (const Eigen::Matrix3d& block : H_point) {
    largest_trace = std::max(largest_trace, block.trace());
  }
  if (!(largest_trace > 0.0)) return false;
  const double damping = 1e-18 * largest_trace;
  std::vector<Eigen::Matrix3d> H_point_inverse(rows.num_points);
  for (int i = 0; i < rows.num_points; ++i) {
    H_point_inverse[i] = (H_point[i] + damping * Eigen::Matrix3d::Identity()).inverse();
    const Eigen::Vector3d from_point = H_point_inverse[i] * imbalance.segment<3>(rows.Point(i));
    for (const int a : observations_of[i]) {
      const int view_a = problem.observations[a].view;
      if (view_a == 0) continue;
      g.segment<3>(rows.Center(view_a)) += S[a] * from_point;
      for (const int b : observations_of[i]) {
        const int view_b = problem.observations[b].view;
        if (view_b == 0) continue;
        H.block<3, 3>(rows.Center(view_a), rows.Center(view_b)) -= S[a] * H_point_inverse[i] * S[b];
      }
    }
  }
  H.diagonal().array() += damping;
  const Eigen::VectorXd lambda_centers = H.ldlt().solve(g);
  if (!lambda_centers.allFinite()) return false;
  const auto lambda_center = [&](int view) -> Eigen::Vector3d {
    if (view == 0) return Eigen::Vector3d::Zero();
    return lambda_centers.segment<3>(rows.Center(view));
  };
  for (int i = 0; i < rows.num_points; ++i) {
    Eigen::Vector3d right = imbalance.segment<3>(rows.Point(i));
    for (const int o : observations_of[i]) {
      right += S[o] * lambda_center(problem.observations[o].view);
    }
    const Eigen::Vector3d lambda_point = H_point_inverse[i] * right;
    for (const int o : observations_of[i]) {
      const Eigen::Vector3d difference = lambda_point - lambda_center(problem.observations[o].view);
      for (int k = 0; k < 5; ++k) {
        double& multiplier = y[5 * o + k];
        multiplier = std::max(0.0, multiplier - multiplier * normals[o][k].dot(difference));
      }
    }
  }
  return true;
}

}  // namespace

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
  RequireUsable(problem, gamma);
  const RowLayout rows{problem.num_views(), problem.num_points};
  LinearProgram program = DualRows(rows);
  const int budget_row = program.num_rows();
  program.AddRow(-kInfinity, kSlackPrice);
  AddMultipliers(problem, gamma, rows, budget_row, {}, 1.0, program);
  return FromDual(SolveLp(program, options), rows);
}

MinimaxLpResult SolveL1Slack(const MinimaxProblem& problem,
                             double gamma,
                             double depth_price,
                             const std::vector<double>& weights,
                             const LpOptions& options) {
  RequireUsable(problem, gamma);
  if (!weights.empty() && weights.size() != problem.observations.size()) {
    throw std::invalid_argument("L1 slack program: one weight per observation expected");
  }
  const std::vector<double> caps =
      weights.empty() ? std::vector<double>(problem.observations.size(), 1.0) : weights;
  const RowLayout rows{problem.num_views(), problem.num_points};
  LinearProgram program = DualRows(rows);
  AddMultipliers(problem, gamma, rows, -1, caps, depth_price, program);
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
  const RowLayout rows{problem.num_views(), problem.num_points};
  NormalTable normals;
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
    if (!RepairStep(problem, normals, rows, imbalance.sum, y)) return false;
  }
}

}  // namespace rotslam
