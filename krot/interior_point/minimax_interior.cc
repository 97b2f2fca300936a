#include "krot/interior_point/minimax_interior.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <Eigen/Dense>

#include "krot/interior_point/interior_start.h"
#include "krot/interior_point/step_rule.h"
#include "krot/lp/lp.h"
#include "krot/structure/half_spaces.h"
#include "rotodom/types/median.h"

namespace rotslam {
namespace {

// Depths of the reference, by observation.
struct ReferenceDepths {
  std::vector<double> typical;  // depth_o: units of slack and of the mean
  std::vector<double> floor;    // least depths
  bool positive = true;         // whether all depths were
};

// The rows of one program: a_k . (X - c) - sigma_k s + r_k = b_k, and e . x = 1.
class Program : public HalfSpaces {
 public:
  Program(const MinimaxProblem& problem,
          double gamma,
          const ReferenceDepths& reference,
          bool slack_on_depth)
      : HalfSpaces(problem, gamma),
        depths_(reference.typical),
        floors_(reference.floor),
        slack_on_depth_(slack_on_depth),
        mean_row_(Eigen::VectorXd::Zero(layout().size())) {
    for (int o = 0; o < size(); ++o) Scatter(o, MeanWeight(o) * DepthAxis(o), mean_row_);
  }

  const Eigen::VectorXd& mean_row() const { return mean_row_; }
  double MeanWeight(int o) const { return 1.0 / (depths_[o] * size()); }

  Five Sigma(int o) const {
    const double depth = depths_[o];
    return {depth, depth, depth, depth, slack_on_depth_ ? depth : 0.0};
  }
  double DepthBound(int o) const { return -floors_[o]; }

 private:
  const std::vector<double>& depths_;
  const std::vector<double>& floors_;
  bool slack_on_depth_;
  Eigen::VectorXd mean_row_;
};

struct Iterate {
  Eigen::VectorXd x;
  double s = 0.0;
  double nu = 0.0;  // multiplier of the mean
  Fives y;
  Fives r;
};

struct Step {
  Eigen::VectorXd x;
  double s = 0.0;
  double nu = 0.0;
  Fives y;
  Fives r;
};

// Slacks of the rows at (x, s).
void UpdateRows(const Program& program, Iterate& at) {
  for (int o = 0; o < program.size(); ++o) {
    at.r[o] = program.Sigma(o) * at.s - program.Apply(o, at.x);
    at.r[o][4] += program.DepthBound(o);
  }
}

// First iterate at `x`: positive slack, all products y r equal.
Iterate Start(const Program& program, const Eigen::VectorXd& x, double margin) {
  Iterate at;
  at.x = x;
  const double mean = program.mean_row().dot(x);
  if (mean > 0.0) at.x /= mean;
  StartRows(program, margin, UpdateRows, at);
  return at;
}

// Newton steps from one iterate: the factor serves predictor and corrector.
class NewtonSystem {
 public:
  NewtonSystem(const Program& program, const Iterate& at, StructureSystem& system, bool refine)
      : program_(program), at_(at), system_(system), refine_(refine), S_(program.size()) {
    Eigen::VectorXd h = Eigen::VectorXd::Zero(program.layout().size());
    dual_sum_ = Eigen::VectorXd::Zero(program.layout().size());
    for (int o = 0; o < program.size(); ++o) {
      const Five D = at.y[o] / at.r[o];
      const Five sigma = program.Sigma(o);
      S_[o] = program.Normal(o, D);
      program.Scatter(o, program.Transposed(o, D * sigma), h);
      program.Scatter(o, program.Transposed(o, at.y[o]), dual_sum_);
      sigma_D_sigma_ += (sigma * D * sigma).sum();
      sigma_y_ += (sigma * at.y[o]).sum();
    }
    dual_sum_ -= at.nu * program.mean_row();
    usable_ = system.Factor(S_);
    if (!usable_) return;
    h_ = h;
    from_h_ = Inverse(h);
    from_mean_ = Inverse(program.mean_row());
    usable_ = from_h_.allFinite() && from_mean_.allFinite();
  }

  bool usable() const { return usable_; }
  // A^T y - nu e, zero when dual feasible.
  const Eigen::VectorXd& dual_sum() const { return dual_sum_; }

  // The step that changes the products y r by `change` to first order, and makes the iterate dual
  // feasible when `with_residuals`.
  Step Solve(const Fives& change, bool with_residuals) const {
    const Eigen::VectorXd& e = program_.mean_row();
    Fives shift(program_.size());
    Eigen::VectorXd g = Eigen::VectorXd::Zero(program_.layout().size());
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    if (with_residuals) {
      g -= dual_sum_;
      right = {1.0 - sigma_y_, 1.0 - e.dot(at_.x)};
    }
    for (int o = 0; o < program_.size(); ++o) {
      shift[o] = change[o] / at_.r[o];
      program_.Scatter(o, program_.Transposed(o, -shift[o]), g);
      right[0] -= (program_.Sigma(o) * shift[o]).sum();
    }
    const Eigen::VectorXd from_g = Inverse(g);
    right -= Eigen::Vector2d(h_.dot(from_g), e.dot(from_g));
    Eigen::Matrix2d border;
    border << h_.dot(from_h_) - sigma_D_sigma_, h_.dot(from_mean_), e.dot(from_h_),
        e.dot(from_mean_);
    const Eigen::Vector2d scalars = border.fullPivLu().solve(right);
    Step step;
    step.s = scalars[0];
    step.nu = scalars[1];
    step.x = from_g + scalars[0] * from_h_ + scalars[1] * from_mean_;
    step.y.resize(program_.size());
    step.r.resize(program_.size());
    for (int o = 0; o < program_.size(); ++o) {
      step.r[o] = program_.Sigma(o) * step.s - program_.Apply(o, step.x);
      step.y[o] = shift[o] - at_.y[o] / at_.r[o] * step.r[o];
    }
    return step;
  }

 private:
  // H x with H = A^T D A, row by row, which is more accurate than the assembled matrix of the
  // factor.
  Eigen::VectorXd Multiply(const Eigen::VectorXd& x) const {
    Eigen::VectorXd product = Eigen::VectorXd::Zero(x.size());
    for (int o = 0; o < program_.size(); ++o) {
      const Five weighted = at_.y[o] / at_.r[o] * program_.Apply(o, x);
      program_.Scatter(o, program_.Transposed(o, weighted), product);
    }
    return product;
  }

  // H^-1 b; with conjugate gradients, preconditioned by the factor, once rounding errors have
  // grown.
  Eigen::VectorXd Inverse(const Eigen::VectorXd& b) const {
    constexpr int kMaxSteps = 10;
    constexpr double kAccuracy = 1e-12;
    Eigen::VectorXd x = system_.Solve(S_, b);
    if (!refine_) return x;
    Eigen::VectorXd residual = b - Multiply(x);
    Eigen::VectorXd z = system_.Solve(S_, residual);
    Eigen::VectorXd direction = z;
    double rho = residual.dot(z);
    const double enough = kAccuracy * kAccuracy * std::abs(b.dot(x));
    for (int step = 0; step < kMaxSteps && rho > enough; ++step) {
      const Eigen::VectorXd along = Multiply(direction);
      const double curvature = direction.dot(along);
      if (!(curvature > 0.0)) break;
      x += rho / curvature * direction;
      residual -= rho / curvature * along;
      z = system_.Solve(S_, residual);
      const double next = residual.dot(z);
      direction = z + next / rho * direction;
      rho = next;
    }
    return x;
  }

  const Program& program_;
  const Iterate& at_;
  StructureSystem& system_;
  bool refine_;
  std::vector<Eigen::Matrix3d> S_;
  Eigen::VectorXd h_;
  Eigen::VectorXd from_h_;
  Eigen::VectorXd from_mean_;
  Eigen::VectorXd dual_sum_;
  double sigma_D_sigma_ = 0.0;
  double sigma_y_ = 0.0;
  bool usable_ = false;
};

void Advance(const Program& program, const Step& step, double primal, double dual, Iterate& at) {
  at.x += primal * step.x;
  at.s += primal * step.s;
  at.nu += dual * step.nu;
  const Fives before = at.r;
  UpdateRows(program, at);
  for (int o = 0; o < program.size(); ++o) {
    at.r[o] = KeptPositive(at.r[o], before[o], step.r[o], primal);
    at.y[o] += dual * step.y[o];
  }
}

// Change that moves the products after a step of that length towards `mu`.
Fives Recentring(const Iterate& at, const Step& step, const Reach& length, double mu) {
  Fives change(at.r.size());
  for (std::size_t o = 0; o < at.r.size(); ++o) {
    change[o] =
        Recentred((at.r[o] + length.primal * step.r[o]) * (at.y[o] + length.dual * step.y[o]), mu);
  }
  return change;
}

void AddTo(const Step& other, Step& step) {
  step.x += other.x;
  step.s += other.s;
  step.nu += other.nu;
  for (std::size_t o = 0; o < step.r.size(); ++o) {
    step.r[o] += other.r[o];
    step.y[o] += other.y[o];
  }
}

bool Finite(const Step& step) {
  if (!step.x.allFinite() || !std::isfinite(step.s) || !std::isfinite(step.nu)) return false;
  for (std::size_t o = 0; o < step.r.size(); ++o) {
    if (!step.r[o].allFinite() || !step.y[o].allFinite()) return false;
  }
  return true;
}

// Dual infeasibility, as a bound on its effect on the objective.
struct Accuracy {
  double dual_error = kInfinity;
  double expected = kInfinity;  // after the last step in exact arithmetic
  bool refine = false;          // steps need conjugate gradients

  void Update(double error, double gap) {
    dual_error = error;
    if (error > 0.01 * gap && error > 2.0 * expected) refine = true;
  }
};

// Mehrotra's centring and correction, then Gondzio's recentring while it increases the step length.
bool NewtonStep(const Program& program, StructureSystem& system, Iterate& at, Accuracy& accuracy) {
  constexpr int kMaxRecentrings = 2;
  const NewtonSystem newton(program, at, system, accuracy.refine);
  if (!newton.usable()) return false;
  const double gap = Complementarity(at);
  accuracy.Update(newton.dual_sum().cwiseAbs().dot(at.x.cwiseAbs()), gap);
  const double mu = gap / (5.0 * program.size());
  Fives change(program.size());
  for (int o = 0; o < program.size(); ++o) change[o] = -at.y[o] * at.r[o];
  const Step predictor = newton.Solve(change, true);
  const Reach free = ReachOf(at.r, predictor.r, at.y, predictor.y);
  const double sum = ProductsAfter(at.r, predictor.r, at.y, predictor.y, free);
  const double shrink = sum / (5.0 * program.size()) / mu;
  const double target = TargetProduct(shrink * shrink * shrink, mu);
  const double trust = free.primal * free.dual;
  for (int o = 0; o < program.size(); ++o) {
    change[o] += target - trust * predictor.y[o] * predictor.r[o];
  }
  Step corrected = newton.Solve(change, true);
  if (!Finite(corrected)) return false;
  const auto [step, reach] = Lengthened(
      std::move(corrected),
      kMaxRecentrings,
      [&](const Step& any) { return ReachOf(at.r, any.r, at.y, any.y); },
      [&](const Step& from, const Reach& aim) {
        Step trial = newton.Solve(Recentring(at, from, aim, target), false);
        AddTo(from, trial);
        return trial;
      });
  if (!Finite(step)) return false;
  accuracy.expected = (1.0 - kShareOfReach * reach.dual) * accuracy.dual_error;
  Advance(program, step, kShareOfReach * reach.primal, kShareOfReach * reach.dual, at);
  return true;
}

// Multipliers of the half-spaces alone: that of the mean is distributed over the depth bounds.
std::vector<double> ConeMultipliers(const Program& program, const Iterate& at) {
  std::vector<double> multipliers;
  multipliers.reserve(5 * at.y.size());
  for (int o = 0; o < program.size(); ++o) {
    for (int k = 0; k < 4; ++k) multipliers.push_back(at.y[o][k]);
    multipliers.push_back(std::max(0.0, at.y[o][4] + at.nu * program.MeanWeight(o)));
  }
  return multipliers;
}

double DualObjective(const Program& program, const Iterate& at) {
  double objective = at.nu;
  for (int o = 0; o < program.size(); ++o) objective -= program.DepthBound(o) * at.y[o][4];
  return objective;
}

// Depths of the reference. Those of points with large residuals are unreliable: small errors of the
// centres may bring such a point close to a centre, and with a depth 40 times too small its slack
// would have 40 times the weight. They count as at least a third of the view's median, and their
// lower bound is loose.
ReferenceDepths TakeDepths(const MinimaxProblem& problem,
                           const MinimaxStructure& reference,
                           double gamma,
                           double depth_floor) {
  constexpr double kFar = 1.5;            // residual in units of gamma
  constexpr double kShareOfMedian = 0.3;  // of the view's depths
  constexpr double kLooseFloor = 0.02;    // instead of InteriorOptions::depth_floor
  ReferenceDepths depths;
  depths.typical.reserve(problem.observations.size());
  depths.floor.reserve(problem.observations.size());
  std::vector<double> residuals(problem.num_points, 0.0);
  std::vector<std::vector<double>> of_view(problem.num_views());
  for (const ImageObservation& observation : problem.observations) {
    const double depth = problem.R_c_w[observation.view].row(2).dot(
        reference.point_in_world[observation.point] - reference.center_in_world[observation.view]);
    depths.typical.push_back(depth);
    if (depth > 0.0) of_view[observation.view].push_back(depth);
    residuals[observation.point] =
        std::max(residuals[observation.point], BoxResidual(problem, reference, observation));
  }
  std::vector<double> medians;
  medians.reserve(of_view.size());
  for (std::vector<double>& values : of_view) medians.push_back(Median(std::move(values)));
  for (std::size_t o = 0; o < problem.observations.size(); ++o) {
    const ImageObservation& observation = problem.observations[o];
    double& depth = depths.typical[o];
    if (residuals[observation.point] <= kFar * gamma) {
      depths.floor.push_back(depth_floor * depth);
      continue;
    }
    const double median = medians[observation.view] > 0.0 ? medians[observation.view] : 1.0;
    if (!(depth > 0.0)) depths.positive = false;
    depths.floor.push_back(kLooseFloor * (depth > 0.0 ? depth : median));
    depth = std::max(depth, kShareOfMedian * median);
  }
  return depths;
}

}  // namespace

MinimaxInterior::MinimaxInterior(const MinimaxProblem& problem)
    : problem_(problem), system_(problem) {}

InteriorResult MinimaxInterior::Solve(double gamma,
                                      const MinimaxStructure& reference,
                                      const InteriorOptions& options) {
  const ReferenceDepths depths = TakeDepths(problem_, reference, gamma, options.depth_floor);
  const Program program(problem_, gamma, depths, !depths.positive);
  Iterate at = Start(program, Packed(program.layout(), reference), 0.3 * gamma);
  InteriorResult result;
  Accuracy accuracy;
  while (result.iterations < options.max_iterations) {
    if (!NewtonStep(program, system_, at, accuracy)) break;
    ++result.iterations;
    if (options.stop_when_feasible && at.s < 0.0) {
      result.converged = true;
      break;
    }
    const double enough = std::max(options.tolerance * gamma, 0.1 * std::abs(at.s));
    const double gap = Complementarity(at);
    if (gap <= enough && accuracy.dual_error <= enough &&
        std::abs(at.s - DualObjective(program, at)) <= enough) {
      result.converged = true;
      break;
    }
    // The gap is closed; only rounding keeps the iterate from being dual feasible.
    if (gap <= 0.01 * enough) break;
  }
  result.structure = Unpacked(program.layout(), at.x);
  result.multipliers = ConeMultipliers(program, at);
  result.slack = at.s;
  result.slack_bound = DualObjective(program, at);
  return result;
}

InteriorResult MinimaxInterior::FindFeasible(double gamma, const InteriorOptions& options) {
  const std::size_t count = problem_.observations.size();
  const ReferenceDepths depths{std::vector<double>(count, 1.0),
                               std::vector<double>(count, options.depth_floor)};
  const Program program(problem_, gamma, depths, true);
  MinimaxStructure first;
  first.center_in_world.assign(problem_.num_views(), Eigen::Vector3d::Zero());
  first.point_in_world.assign(problem_.num_points, Eigen::Vector3d::Zero());
  for (const ImageObservation& observation : problem_.observations) {
    first.point_in_world[observation.point] +=
        problem_.R_c_w[observation.view].transpose() * observation.xy.homogeneous().normalized();
  }
  Iterate at = Start(program, Packed(program.layout(), first), 1.0);
  InteriorResult result;
  Accuracy accuracy;
  while (result.iterations < options.max_iterations) {
    if (!NewtonStep(program, system_, at, accuracy)) break;
    ++result.iterations;
    result.structure = Unpacked(program.layout(), at.x);
    const double residual = MaxBoxResidual(problem_, result.structure);
    if (residual <= 2.0 * gamma) {
      result.converged = true;
      break;
    }
  }
  result.slack = at.s;
  result.slack_bound = DualObjective(program, at);
  result.multipliers = ConeMultipliers(program, at);
  return result;
}

}  // namespace rotslam
