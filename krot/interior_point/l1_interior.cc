#include "krot/interior_point/l1_interior.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>

#include "krot/interior_point/step_rule.h"
#include "krot/structure/half_spaces.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

// The program: min p . s  s.t.  A x - s + r = b,  s >= 0,  r >= 0, with multipliers y of r and z =
// p - y of s; at the optimum A^T y = 0, y r = 0, z s = 0.
class Program : public HalfSpaces {
 public:
  explicit Program(const L1SlackProgram& l1)
      : HalfSpaces(l1.problem, l1.gamma), prices_(l1.problem.observations.size()) {
    for (int o = 0; o < size(); ++o) {
      const double weight = l1.weights.empty() ? 1.0 : l1.weights[o];
      prices_[o] = Five::Constant(weight);
      prices_[o][4] *= l1.depth_price;
    }
  }

  const Five& Price(int o) const { return prices_[o]; }
  // b - A x
  Five Room(int o, const Eigen::VectorXd& x) const {
    Five room = -Apply(o, x);
    room[4] -= 1.0;
    return room;
  }

 private:
  Fives prices_;
};

struct Iterate {
  Eigen::VectorXd x;
  Fives r, s, y, z;
  double imbalance = 1.0;  // norm of A^T y relative to the first one
};

struct Step {
  Eigen::VectorXd x;
  Fives r, s, y, z;
};

// Target products y r and z s.
struct Products {
  Fives yr, zs;
};

// First iterate at `x`, exactly central: y r = z s = mu.
Iterate Start(const Program& program, Eigen::VectorXd x, double mu) {
  Iterate at;
  at.x = std::move(x);
  const int count = program.size();
  at.r.resize(count);
  at.s.resize(count);
  at.y.resize(count);
  at.z.resize(count);
  for (int o = 0; o < count; ++o) {
    // r - s = room and 1 / r + 1 / s = price / mu.
    const Five room = program.Room(o, at.x);
    const Five m = mu / program.Price(o);
    const Five root = (room.square() + 4.0 * m.square()).sqrt();
    const Five less = m + 2.0 * m.square() / (root + room.abs());  // the smaller of r and s
    at.r[o] = less + room.max(0.0);
    at.s[o] = less - room.min(0.0);
    at.y[o] = mu / at.r[o];
    at.z[o] = mu / at.s[o];
  }
  return at;
}

double Complementarity(const Iterate& at) {
  double sum = 0.0;
  for (std::size_t o = 0; o < at.r.size(); ++o) {
    sum += (at.y[o] * at.r[o] + at.z[o] * at.s[o]).sum();
  }
  return sum;
}

double Objective(const Program& program, const Iterate& at) {
  double sum = 0.0;
  for (int o = 0; o < program.size(); ++o) sum += (program.Price(o) * at.s[o]).sum();
  return sum;
}

// Newton steps from one iterate: the factor serves predictor and corrector.
class NewtonSystem {
 public:
  NewtonSystem(const Program& program, const Iterate& at, StructureSystem& system)
      : program_(program), at_(at), system_(system), D_(program.size()), S_(program.size()) {
    imbalance_ = Eigen::VectorXd::Zero(program.layout().size());
    for (int o = 0; o < program.size(); ++o) {
      D_[o] = (at.s[o] / at.z[o] + at.r[o] / at.y[o]).inverse();
      S_[o] = program.Normal(o, D_[o]);
      program.Scatter(o, program.Transposed(o, at.y[o]), imbalance_);
    }
    usable_ = system.Factor(S_);
  }

  bool usable() const { return usable_; }
  // A^T y, zero when dual feasible.
  const Eigen::VectorXd& imbalance() const { return imbalance_; }

  // The step that changes the products by `change` to first order, and makes A^T y zero when
  // `with_imbalance`.
  Step Solve(const Products& change, bool with_imbalance) const {
    Eigen::VectorXd right =
        with_imbalance ? Eigen::VectorXd(-imbalance_) : Eigen::VectorXd::Zero(imbalance_.size());
    Fives shift(program_.size());
    for (int o = 0; o < program_.size(); ++o) {
      shift[o] = change.zs[o] / at_.z[o] - change.yr[o] / at_.y[o];
      program_.Scatter(o, program_.Transposed(o, D_[o] * shift[o]), right);
    }
    Step step;
    step.x = Inverse(right, with_imbalance);
    step.r.resize(program_.size());
    step.s.resize(program_.size());
    step.y.resize(program_.size());
    step.z.resize(program_.size());
    for (int o = 0; o < program_.size(); ++o) {
      step.y[o] = D_[o] * (program_.Apply(o, step.x) - shift[o]);
      step.z[o] = -step.y[o];
      step.r[o] = (change.yr[o] - at_.r[o] * step.y[o]) / at_.y[o];
      step.s[o] = (change.zs[o] + at_.s[o] * step.y[o]) / at_.z[o];
    }
    return step;
  }

 private:
  Eigen::VectorXd Multiply(const Eigen::VectorXd& x) const {
    Eigen::VectorXd product = Eigen::VectorXd::Zero(x.size());
    for (int o = 0; o < program_.size(); ++o) {
      program_.Scatter(o, program_.Transposed(o, D_[o] * program_.Apply(o, x)), product);
    }
    return product;
  }

  // One step of iterative refinement, since the factored matrix sums rows of very different
  // weights.
  Eigen::VectorXd Inverse(const Eigen::VectorXd& b, bool refine) const {
    Eigen::VectorXd x = system_.Solve(S_, b);
    if (refine) x += system_.Solve(S_, b - Multiply(x));
    return x;
  }

  const Program& program_;
  const Iterate& at_;
  StructureSystem& system_;
  Fives D_;
  std::vector<Eigen::Matrix3d> S_;
  Eigen::VectorXd imbalance_;
  bool usable_ = false;
};

Reach ReachOf(const Iterate& at, const Step& step) {
  return {std::min(StepToBoundary(at.r, step.r), StepToBoundary(at.s, step.s)),
          std::min(StepToBoundary(at.y, step.y), StepToBoundary(at.z, step.z))};
}

void Advance(const Program& program, const Step& step, double primal, double dual, Iterate& at) {
  at.x += primal * step.x;
  for (int o = 0; o < program.size(); ++o) {
    at.r[o] += primal * step.r[o];
    // The larger of s and r follows from the row, so that rounding errors do not accumulate.
    at.s[o] += primal * step.s[o];
    const Five room = program.Room(o, at.x);
    const Five from_s = at.s[o] + room;
    const Five from_r = at.r[o] - room;
    const auto more_s = at.s[o] > at.r[o];
    const Five r = more_s.select(at.r[o], from_s);
    const Five s = more_s.select(from_r, at.s[o]);
    at.r[o] = (r > 0.0).select(r, at.r[o]);
    at.s[o] = (s > 0.0).select(s, at.s[o]);
    at.y[o] += dual * step.y[o];
    at.z[o] += dual * step.z[o];
  }
  at.imbalance *= 1.0 - dual;
}

bool Finite(const Step& step) {
  if (!step.x.allFinite()) return false;
  return std::all_of(step.y.begin(), step.y.end(), [](const Five& y) { return y.allFinite(); });
}

// Change that moves the products after a step of that length towards `mu`.
Products Recentring(const Iterate& at, const Step& step, const Reach& length, double mu) {
  const auto [primal, dual] = length;
  Products change{Fives(at.r.size()), Fives(at.r.size())};
  for (std::size_t o = 0; o < at.r.size(); ++o) {
    change.yr[o] = Recentred((at.r[o] + primal * step.r[o]) * (at.y[o] + dual * step.y[o]), mu);
    change.zs[o] = Recentred((at.s[o] + primal * step.s[o]) * (at.z[o] + dual * step.z[o]), mu);
  }
  return change;
}

void AddTo(const Step& other, Step& step) {
  step.x += other.x;
  for (std::size_t o = 0; o < step.r.size(); ++o) {
    step.r[o] += other.r[o];
    step.s[o] += other.s[o];
    step.y[o] += other.y[o];
    step.z[o] += other.z[o];
  }
}

// Mehrotra's centring and correction, then Gondzio's recentring while it increases the step length.
bool NewtonStep(const Program& program, StructureSystem& system, Iterate& at) {
  constexpr int kMaxRecentrings = 4;
  // Exponent of the centring parameter. Mehrotra's 3 suits steps without recentring; with it the
  // number of iterations is smaller at 12.
  constexpr double kGreed = 12.0;
  const NewtonSystem newton(program, at, system);
  if (!newton.usable()) return false;
  const double count = 10.0 * program.size();
  const double mu = Complementarity(at) / count;
  Products change{Fives(program.size()), Fives(program.size())};
  for (int o = 0; o < program.size(); ++o) {
    change.yr[o] = -at.y[o] * at.r[o];
    change.zs[o] = -at.z[o] * at.s[o];
  }
  const Step predictor = newton.Solve(change, true);
  if (!Finite(predictor)) return false;
  const auto [primal, dual] = ReachOf(at, predictor);
  double ahead = 0.0;
  for (int o = 0; o < program.size(); ++o) {
    ahead += ((at.y[o] + dual * predictor.y[o]) * (at.r[o] + primal * predictor.r[o]) +
              (at.z[o] + dual * predictor.z[o]) * (at.s[o] + primal * predictor.s[o]))
                 .sum();
  }
  const double shrink = ahead / count / mu;
  const double target = TargetProduct(std::pow(shrink, kGreed), mu);
  const double trust = primal * dual;
  for (int o = 0; o < program.size(); ++o) {
    change.yr[o] += target - trust * predictor.y[o] * predictor.r[o];
    change.zs[o] += target - trust * predictor.z[o] * predictor.s[o];
  }
  Step corrected = newton.Solve(change, true);
  if (!Finite(corrected)) return false;
  const auto [step, reach] = Lengthened(
      std::move(corrected),
      kMaxRecentrings,
      [&](const Step& any) { return ReachOf(at, any); },
      [&](const Step& from, const Reach& aim) {
        Step trial = newton.Solve(Recentring(at, from, aim, target), false);
        AddTo(from, trial);
        return trial;
      });
  if (!Finite(step)) return false;
  Advance(program, step, kShareOfReach * reach.primal, kShareOfReach * reach.dual, at);
  return true;
}

// All centres at the origin, points at depth one along their bearings' mean.
Eigen::VectorXd PointsAround(const MinimaxProblem& problem, const StructureLayout& layout) {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(layout.size());
  for (const ImageObservation& observation : problem.observations) {
    x.segment<3>(layout.Point(observation.point)) +=
        problem.R_c_w[observation.view].transpose() * observation.xy.homogeneous().normalized();
  }
  for (int i = 0; i < layout.num_points; ++i) x.segment<3>(layout.Point(i)).normalize();
  return x;
}

LpCallStatus Converge(const L1SlackProgram& l1,
                      const Program& program,
                      const L1InteriorOptions& options,
                      Iterate& at,
                      int& iterations) {
  StructureSystem system(l1.problem);
  for (iterations = 0; iterations < options.max_iterations; ++iterations) {
    const double enough = options.tolerance * (Objective(program, at) + l1.depth_price);
    const bool balanced = at.imbalance <= options.tolerance;
    if (balanced && Complementarity(at) <= enough) return LpCallStatus::kCompleted;
    if (!NewtonStep(program, system, at)) break;
  }
  return LpCallStatus::kFailed;
}

}  // namespace

MinimaxLpResult SolveL1SlackInterior(const L1SlackProgram& l1,
                                     const L1InteriorOptions& options,
                                     const MinimaxStructure* start) {
  RequireL1Program(l1);
  MinimaxLpResult result;
  {
    const Stopwatch stopwatch(result.seconds);
    const Program program(l1);
    Iterate at = Start(program,
                       start == nullptr ? PointsAround(l1.problem, program.layout())
                                        : Packed(program.layout(), *start),
                       options.first_product);
    result.call = Converge(l1, program, options, at, result.iterations);
    result.structure = Unpacked(program.layout(), at.x);
    result.objective = Objective(program, at);
    result.multipliers.reserve(5 * at.y.size());
    for (const Five& y : at.y) {
      result.multipliers.insert(result.multipliers.end(), y.begin(), y.end());
    }
  }
  if (result.call == LpCallStatus::kCompleted) result.model = LpModelStatus::kOptimal;
  return result;
}

}  // namespace rotslam
