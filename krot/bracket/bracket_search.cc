#include "krot/bracket/bracket_search.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "krot/bracket/working_set.h"
#include "krot/interior_point/minimax_interior.h"
#include "krot/interior_point/minimax_point.h"
#include "krot/structure/minimax_lp.h"
#include "krot/structure/structure_system.h"

namespace rotslam {
namespace {

// The interior programs start from about this many points in each view ...
constexpr int kPointsPerView = 8;
// ... and each round adds, for each view, this many of those that miss the bound most. Adding all
// that miss it makes the programs explode.
constexpr int kAddedPerView = 4;

MinimaxStructure Restrict(const MinimaxStructure& structure, const std::vector<int>& points) {
  MinimaxStructure restricted;
  restricted.center_in_world = structure.center_in_world;
  restricted.point_in_world.reserve(points.size());
  for (const int point : points)
    restricted.point_in_world.push_back(structure.point_in_world[point]);
  return restricted;
}

std::vector<AffineProjection> ProjectionsOf(const MinimaxProblem& problem,
                                            const PointGroups& groups,
                                            const MinimaxStructure& structure,
                                            int point) {
  std::vector<AffineProjection> projections;
  projections.reserve(groups.begin[point + 1] - groups.begin[point]);
  for (int k = groups.begin[point]; k < groups.begin[point + 1]; ++k) {
    const ImageObservation& observation = problem.observations[groups.observations[k]];
    projections.push_back(ProjectionOfPoint(problem.R_c_w[observation.view],
                                            structure.center_in_world[observation.view],
                                            observation.xy));
  }
  return projections;
}

// What takes `from` nearest to `to`; one where that is no positive number.
double ScaleBetween(const std::vector<Eigen::Vector3d>& from,
                    const std::vector<Eigen::Vector3d>& to) {
  double product = 0.0;
  double square = 0.0;
  for (std::size_t k = 0; k < from.size(); ++k) {
    product += from[k].dot(to[k]);
    square += from[k].squaredNorm();
  }
  return product > 0.0 && square > 0.0 ? product / square : 1.0;
}

// Alternates programs over the working set with triangulation of all other points. A program of the
// set proves lower bounds for all; upper bounds are of all points by construction.
// The class is longer than others: every step reads and moves the target, the bracket and both
// structures, so that parts of it could only share all of these.
class Search {
 public:
  Search(const MinimaxProblem& problem,
         const BisectionOptions& options,
         const SearchLimits& limits,
         Bracket& bracket)
      : problem_(problem),
        options_(options),
        limits_(limits),
        bracket_(bracket),
        groups_(problem),
        residuals_(problem.num_points, kInfinity),
        chosen_(SpreadPoints(problem, kPointsPerView)) {
    // What triangulation would cost is more than a few more points in the programs.
    constexpr int kFew = 100;
    if (problem.num_points <= kFew) chosen_.assign(problem.num_points, true);
    structure_.center_in_world.assign(problem.num_views(), Eigen::Vector3d::Zero());
    structure_.point_in_world.assign(problem.num_points, Eigen::Vector3d::Zero());
    TakeWorkingSet();
  }

  void Run(const MinimaxStructure* start) {
    if (!Begin(start)) return;
    bracket_.status = BisectionStatus::kIterationLimit;
    while (true) {
      if (limits_.only_feasible || !Continue(options_, bracket_, part_.problem.num_points)) {
        bracket_.status = BisectionStatus::kCancelled;
        return;
      }
      if (Narrow(bracket_, options_, limits_)) {
        bracket_.status = BisectionStatus::kConverged;
        return;
      }
      constexpr int kMaxUndecidedInARow = 7;
      if (bracket_.num_programs >= limits_.max_programs) return;
      if (undecided_in_a_row_ >= kMaxUndecidedInARow) return;
      Step();
    }
  }

 private:
  static constexpr double kFloor = 0.5;
  static constexpr double kLeastFloor = 0.03;

  // A target that could not be reached, and by how much.
  struct Miss {
    double gamma;
    double slack;
  };

  // The first structure: the caller's or that of the easiest programs.
  bool Begin(const MinimaxStructure* start) {
    if (start != nullptr) TakeStart(*start);
    // A start that misses by more than these do is worse than none.
    for (double gamma = 0.1; part_high_ > 2.0 * gamma && gamma < 1000.0; gamma *= 10.0) {
      const InteriorResult first = interior_->FindFeasible(gamma, {});
      ++bracket_.num_programs;
      Take(first.structure);
      if (part_high_ == kInfinity)
        Take(SolveFeasibility(part_.problem, gamma, options_.lp).structure);
    }
    if (part_high_ == kInfinity) return false;
    predicted_ = 0.7 * part_high_;
    target_ = predicted_;
    Triangulate(part_high_);
    return bracket_.gamma_high < kInfinity || !chosen_all_;
  }

  // Points behind a camera are placed anew where the centres allow it.
  void TakeStart(const MinimaxStructure& start) {
    structure_ = start;
    for (int i = 0; i < problem_.num_points; ++i) {
      if (MaxPointResidual(ProjectionsOf(problem_, groups_, structure_, i),
                           structure_.point_in_world[i]) == kInfinity) {
        Triangulate(i, 0.0);
      }
    }
    Offer(problem_, structure_, bracket_);
    TakeWorkingSet();
  }

  // One program, then the points outside where the inside is settled.
  void Step() {
    decided_ = true;
    if (!settled_) {
      Descend();
    } else if (part_high_ > target_) {
      Reach();
    }
    if (settled_ && part_high_ <= target_) Grow();
    undecided_in_a_row_ = decided_ ? 0 : undecided_in_a_row_ + 1;
    bracket_.num_undecided += !decided_;
    if (!decided_) KeepInside();
  }

  // The worst points beyond the target join the set; where there are none, the target sinks.
  void Grow() {
    const double limit = Limit();
    Triangulate(limit);
    misses_.clear();
    if (AddWorstPoints(problem_, residuals_, limit, kAddedPerView, chosen_) > 0) {
      TakeWorkingSet();
    } else {
      LowerTarget();
    }
  }

  // Towards the optimum of the first points from far above. The set then grows at targets well
  // above it, where structures are easily found and stay central, and the points that come last are
  // few.
  void Descend() {
    constexpr double kAbove = 5.0;
    const double gamma = predicted_ * (1.0 - 0.4 * options_.relative_gap);
    const double slack = Optimise(gamma);
    settled_ = slack > 0.0 || part_high_ <= 1.1 * predicted_;
    target_ = kAbove * std::max(predicted_, gamma);
  }

  // A structure within the target, or the proof that there is none. Where there is one, it stays
  // well inside: at the optimum of a few points, parts of a structure are free to shrink, which
  // others then miss. For the same reason structures beyond the target are not taken.
  void Reach() {
    InteriorOptions interior_options = ProgramOptions();
    interior_options.stop_when_feasible = true;
    const InteriorResult result = Run(target_, interior_options);
    const bool proven = result.slack > 0.0 && Prove(target_, result.multipliers);
    const double before = part_high_;
    if (!proven) Take(result.structure);
    if (proven || result.slack < 0.0) floor_ = kFloor;
    if (part_high_ <= target_) return;
    if (proven) {
      misses_.push_back({target_, result.slack});
      RaiseTarget();
    } else if (floor_ > kLeastFloor) {
      // What the reference allows may be too little.
      floor_ *= 0.2;
    } else if (!result.converged) {
      AskEngine();
    } else if (part_high_ > 0.9 * before) {
      decided_ = false;
      given_up_ = std::max(given_up_, target_);
      misses_.push_back({target_, result.slack});
      RaiseTarget();
    }
  }

  // Where our programs stall.
  void AskEngine() {
    const MinimaxLpResult lp = SolveFeasibility(part_.problem, target_, options_.lp);
    ++bracket_.num_programs;
    Take(lp.structure);
    if (part_high_ <= target_) return;
    if (Prove(target_, lp.multipliers)) {
      RaiseTarget();
    } else {
      decided_ = false;
    }
  }

  // No structure is within the target: where the slack of the last two misses runs out, or three
  // times the slack further.
  void RaiseTarget() {
    const double gap = options_.relative_gap;
    double next = target_ * (1.0 + 0.2 * gap);
    if (!misses_.empty()) next = std::max(next, target_ + 3.0 * misses_.back().slack);
    if (misses_.size() >= 2) {
      const Miss& a = misses_[misses_.size() - 2];
      const Miss& b = misses_.back();
      if (a.slack > b.slack && b.gamma > a.gamma) {
        next = b.gamma + b.slack * (b.gamma - a.gamma) / (a.slack - b.slack);
      }
    }
    target_ = std::max(next * (1.0 + 0.4 * gap), MiddleTarget(bracket_.gamma_high));
    KeepInside();
  }

  // Far above the optimum points a little beyond the target need not join.
  double Limit() const {
    constexpr double kFar = 1.2;
    return bracket_.gamma_high > kFar * kFar * Low() ? kFar * target_ : target_;
  }

  // Below it there is nothing, or nothing we could find.
  double Low() const { return std::max(bracket_.gamma_low, given_up_); }

  // All points are within the target, or near enough.
  void LowerTarget() {
    constexpr double kStep = 0.6;
    const double high = std::min(bracket_.gamma_high, target_);
    target_ = Low() > 0.0 ? MiddleTarget(high) : kStep * high;
    KeepInside();
  }

  // Nearer to the upper bound than to the lower: between the optimum of the set and that of all
  // points, structures are distorted, and those that come next start from them.
  double MiddleTarget(double high) const {
    constexpr double kTowardsHigh = 0.7;
    return high == kInfinity ? 0.0 : Low() * std::pow(high / Low(), kTowardsHigh);
  }

  // Below the upper bound by the better part of the gap, so that a proof there ends the search;
  // elsewhere in the gap after answers that decided nothing.
  void KeepInside() {
    static constexpr double kShares[] = {0.7, 0.9, 0.5, 0.8, 0.6, 0.95, 0.4};
    const double share = kShares[undecided_in_a_row_ % 7];
    const double below = bracket_.gamma_high * (1.0 - share * options_.relative_gap);
    target_ = std::min(target_, below);
    if (below < bracket_.gamma_low * (1.0 + 2.0 * options_.relative_gap)) target_ = below;
  }

  InteriorOptions ProgramOptions() const {
    InteriorOptions interior_options;
    interior_options.tolerance = 0.05 * options_.relative_gap;
    interior_options.depth_floor = part_high_ > 1.5 * target_ ? std::min(floor_, 0.1) : floor_;
    return interior_options;
  }

  InteriorResult Run(double gamma, const InteriorOptions& interior_options) {
    InteriorResult result = interior_->Solve(gamma, working_, interior_options);
    ++bracket_.num_programs;
    return result;
  }

  // The program at `gamma` to its end; its slack.
  double Optimise(double gamma) {
    const InteriorResult result = Run(gamma, ProgramOptions());
    Take(result.structure);
    predicted_ = gamma + std::max(result.slack_bound, -0.9 * gamma);
    if (result.slack > 0.0) Prove(gamma, result.multipliers);
    return result.slack;
  }

  bool Prove(double gamma, const std::vector<double>& multipliers) {
    if (gamma <= bracket_.gamma_low) return true;
    if (!CertifiesInfeasible(part_.problem, gamma, multipliers, kMaxExtent)) return false;
    bracket_.gamma_low = gamma;
    return true;
  }

  // Where it is better than the one at hand.
  void Take(const MinimaxStructure& structure) {
    if (structure.point_in_world.empty()) return;
    const double residual = MaxBoxResidual(part_.problem, structure);
    if (residual >= part_high_) return;
    part_high_ = residual;
    working_ = structure;
    // In the scale of the points outside, which start their triangulation from where they are.
    const double scale = ScaleBetween(structure.center_in_world, structure_.center_in_world);
    for (Eigen::Vector3d& center : working_.center_in_world) center *= scale;
    for (Eigen::Vector3d& point : working_.point_in_world) point *= scale;
    structure_.center_in_world = working_.center_in_world;
    for (std::size_t k = 0; k < part_.points.size(); ++k) {
      structure_.point_in_world[part_.points[k]] = working_.point_in_world[k];
    }
  }

  void TakeWorkingSet() {
    interior_.reset();
    part_ = RestrictToPoints(problem_, chosen_);
    chosen_all_ = part_.problem.num_points == problem_.num_points;
    bracket_.num_points_in_programs = part_.problem.num_points;
    interior_ = std::make_unique<MinimaxInterior>(part_.problem);
    working_ = Restrict(structure_, part_.points);
    part_high_ = MaxBoxResidual(part_.problem, working_);
  }

  // Residuals of all points, those outside the set moved where they are above `limit`: by least
  // squares, and exactly those that would join the set. Offers the whole.
  void Triangulate(double limit) {
    std::vector<bool> exact = chosen_;
    for (int i = 0; i < problem_.num_points; ++i) {
      const std::vector<AffineProjection> projections =
          ProjectionsOf(problem_, groups_, structure_, i);
      residuals_[i] = MaxPointResidual(projections, structure_.point_in_world[i]);
      if (chosen_[i] || residuals_[i] <= limit) continue;
      Move(i, projections, LeastSquaresPoint(projections));
      if (residuals_[i] == kInfinity) Triangulate(i, limit);
    }
    constexpr int kMaxRounds = 4;
    for (int round = 0; round < kMaxRounds; ++round) {
      std::vector<bool> worst = chosen_;
      AddWorstPoints(problem_, residuals_, limit, kAddedPerView, worst);
      bool moved = false;
      for (int i = 0; i < problem_.num_points; ++i) {
        if (!worst[i] || exact[i]) continue;
        exact[i] = true;
        moved = true;
        Triangulate(i, limit);
      }
      if (!moved) break;
    }
    const double largest = *std::max_element(residuals_.begin(), residuals_.end());
    if (largest < bracket_.gamma_high) Offer(problem_, structure_, bracket_);
  }

  // One point, to the optimum or to where it is good enough.
  void Triangulate(int i, double good_enough) {
    // Which points are worst is all that matters of those above.
    MinimaxPointOptions point_options;
    point_options.relative_gap = 0.1;
    point_options.good_enough = good_enough;
    const std::vector<AffineProjection> projections =
        ProjectionsOf(problem_, groups_, structure_, i);
    Move(i,
         projections,
         FindMinimaxPoint(projections, structure_.point_in_world[i], point_options).position);
  }

  void Move(int i,
            const std::vector<AffineProjection>& projections,
            const Eigen::Vector3d& position) {
    const double residual = MaxPointResidual(projections, position);
    if (!(residual < residuals_[i])) return;
    residuals_[i] = residual;
    structure_.point_in_world[i] = position;
  }

  const MinimaxProblem& problem_;
  const BisectionOptions& options_;
  const SearchLimits& limits_;
  Bracket& bracket_;
  PointGroups groups_;
  std::vector<double> residuals_;  // largest of each point
  std::vector<bool> chosen_;       // the working set
  bool chosen_all_ = false;
  SubProblem part_;           // the working set's problem
  MinimaxStructure working_;  // and its best structure
  double part_high_ = kInfinity;
  MinimaxStructure structure_;  // of all points, centres as in working_
  std::unique_ptr<MinimaxInterior> interior_;
  double predicted_ = 0.0;  // the optimum of the working set, by the last program
  double target_ = 0.0;     // above which points outside join the set
  double given_up_ = 0.0;   // highest target that could neither be reached nor excluded
  double floor_ = kFloor;   // InteriorOptions::depth_floor
  std::vector<Miss> misses_;
  bool settled_ = false;  // the working set's optimum is about where the target is
  bool decided_ = true;   // the last step brought something
  int undecided_in_a_row_ = 0;
};

}  // namespace

Bracket SearchBracket(const MinimaxProblem& problem,
                      const BisectionOptions& options,
                      const SearchLimits& limits,
                      const MinimaxStructure* start) {
  Bracket bracket;
  Search(problem, options, limits, bracket).Run(start);
  if (start != nullptr && bracket.status == BisectionStatus::kIterationLimit) {
    // Degenerate starts lead astray; what they gave is kept.
    Search(problem, options, limits, bracket).Run(nullptr);
  }
  return bracket;
}

Bracket SearchSingleView(const MinimaxProblem& problem, const BisectionOptions& options) {
  const Eigen::Vector2d far = Eigen::Vector2d::Constant(kInfinity);
  std::vector<Eigen::Vector2d> least(problem.num_points, far);
  std::vector<Eigen::Vector2d> greatest(problem.num_points, -far);
  for (const ImageObservation& observation : problem.observations) {
    least[observation.point] = least[observation.point].cwiseMin(observation.xy);
    greatest[observation.point] = greatest[observation.point].cwiseMax(observation.xy);
  }
  Bracket bracket;
  bracket.structure.center_in_world.assign(1, Eigen::Vector3d::Zero());
  double half_range = 0.0;
  for (int i = 0; i < problem.num_points; ++i) {
    const Eigen::Vector2d middle = 0.5 * (least[i] + greatest[i]);
    bracket.structure.point_in_world.emplace_back(problem.R_c_w.front().transpose() *
                                                  Eigen::Vector3d(middle.x(), middle.y(), 1.0));
    half_range = std::max(half_range, 0.5 * (greatest[i] - least[i]).maxCoeff());
  }
  constexpr double kRounding = 1e-14;  // of the difference of two coordinates
  bracket.gamma_low = std::max(0.0, half_range - kRounding);
  bracket.gamma_high = MaxBoxResidual(problem, bracket.structure);
  bracket.status =
      Narrow(bracket, options, {}) ? BisectionStatus::kConverged : BisectionStatus::kIterationLimit;
  return bracket;
}

}  // namespace rotslam
