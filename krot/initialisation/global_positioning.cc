#include "krot/initialisation/global_positioning.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "krot/structure/structure_system.h"

namespace rotslam {
namespace {

// Scale of the loss at the start, rad: large, because initial errors are.
constexpr double kFirstLossRad = 0.1;
constexpr int kMaxSteps = 200;
// The loss is reduced after kSmallGains steps with a relative gain below this. Long chains converge
// slowly: at 1e-3 the positions along a street with one outlier in three are twenty times less
// accurate.
constexpr double kLeastGain = 1e-5;
constexpr int kSmallGains = 3;
// Damping of the depths relative to their curvature: start and bounds.
constexpr double kFirstDamping = 1.0;
constexpr double kMinDamping = 1e-6;
constexpr double kMaxDamping = 1e8;
// Largest factor by which a step changes a depth, which keeps depths positive.
constexpr double kMaxDepthFactor = 10.0;

class GlobalPositioning {
 public:
  explicit GlobalPositioning(const MinimaxProblem& problem)
      : problem_(problem),
        system_(problem),
        layout_{problem.num_views(), problem.num_points},
        inverse_depths_(problem.observations.size(), 1.0),
        S_(problem.observations.size()) {
    rays_.reserve(problem.observations.size());
    for (const ImageObservation& observation : problem.observations) {
      rays_.push_back(problem.R_c_w[observation.view].transpose() *
                      observation.xy.homogeneous().normalized());
    }
  }

  std::optional<MinimaxStructure> Solve(double loss_rad) {
    if (!StartFromEqualDepths()) return std::nullopt;
    for (const double loss : {std::max(kFirstLossRad, loss_rad), loss_rad}) {
      loss_ = loss;
      if (!Minimise()) return std::nullopt;
    }
    return Structure();
  }

 private:
  struct Step {
    Eigen::VectorXd x;
    std::vector<double> inverse_depths;
    double model_gain = 0.0;
  };

  int num_observations() const { return static_cast<int>(rays_.size()); }

  Eigen::Vector3d Center(const Eigen::VectorXd& x, int view) const {
    if (view == 0) return Eigen::Vector3d::Zero();
    return x.segment<3>(layout_.Center(view));
  }

  // Vector from the centre to the point of an observation.
  Eigen::Vector3d Between(const Eigen::VectorXd& x, int o) const {
    const ImageObservation& observation = problem_.observations[o];
    return x.segment<3>(layout_.Point(observation.point)) - Center(x, observation.view);
  }

  // Adds `g` to the right-hand side at an observation's point, and subtracts it at its centre.
  void AddGradient(int o, const Eigen::Vector3d& g, Eigen::VectorXd& b) const {
    const ImageObservation& observation = problem_.observations[o];
    b.segment<3>(layout_.Point(observation.point)) += g;
    if (observation.view > 0) b.segment<3>(layout_.Center(observation.view)) -= g;
  }

  bool StartFromEqualDepths() {
    Eigen::VectorXd b = Eigen::VectorXd::Zero(layout_.size());
    for (int o = 0; o < num_observations(); ++o) {
      S_[o].setIdentity();
      AddGradient(o, rays_[o], b);
    }
    if (!system_.Factor(S_)) return false;
    x_ = system_.Solve(S_, b);
    return x_.allFinite();
  }

  double Weight(double residual) const {
    const double ratio = residual / loss_;
    const double root = 1.0 / (1.0 + ratio * ratio);
    return root * root;
  }

  // Half the sum of squares with the Geman-McClure loss.
  double Cost(const Eigen::VectorXd& x, const std::vector<double>& inverse_depths) const {
    double cost = 0.0;
    for (int o = 0; o < num_observations(); ++o) {
      const double r = (rays_[o] - inverse_depths[o] * Between(x, o)).norm();
      cost += 0.5 * r * r / (1.0 + r * r / (loss_ * loss_));
    }
    return cost;
  }

  // Levenberg-Marquardt for one scale of the loss, with Nielsen's damping rule. False when a system
  // cannot be solved.
  bool Minimise() {
    double cost = Cost(x_, inverse_depths_);
    double damping = kFirstDamping;
    double growth = 2.0;
    int small_gains = 0;
    for (int k = 0; k < kMaxSteps && small_gains < kSmallGains && damping < kMaxDamping; ++k) {
      std::optional<Step> step = FindStep(damping);
      if (!step) return false;
      const Eigen::VectorXd x = x_ + step->x;
      const double next = Cost(x, step->inverse_depths);
      if (!(next < cost)) {
        damping *= growth;
        growth *= 2.0;
        continue;
      }
      const double ratio = (cost - next) / step->model_gain;
      damping *= std::max(1.0 / 3.0, 1.0 - std::pow(2.0 * ratio - 1.0, 3));
      damping = std::max(damping, kMinDamping);
      growth = 2.0;
      small_gains = cost - next < kLeastGain * cost ? small_gains + 1 : 0;
      x_ = x;
      inverse_depths_ = std::move(step->inverse_depths);
      cost = next;
    }
    return true;
  }

  // Minimises the squares of v - s (X - c), linearised in s, X and c and weighted by the loss, plus
  // `damping` times the squares of (X - c) ds. With ds eliminated an observation contributes w s^2
  // (I - y y^T / ((1 + damping) y^T y)) between X and c, with y = X - c.
  std::optional<Step> FindStep(double damping) {
    Eigen::VectorXd b = Eigen::VectorXd::Zero(layout_.size());
    for (int o = 0; o < num_observations(); ++o) {
      const Eigen::Vector3d y = Between(x_, o);
      const double s = inverse_depths_[o];
      const Eigen::Vector3d residual = rays_[o] - s * y;
      const Eigen::Matrix3d across =
          Eigen::Matrix3d::Identity() - y * y.transpose() / DampedSquare(y, damping);
      const double weight = Weight(residual.norm());
      S_[o] = weight * s * s * across;
      AddGradient(o, weight * s * across * residual, b);
    }
    if (!system_.Factor(S_)) return std::nullopt;
    Step step;
    step.x = system_.Solve(S_, b);
    if (!step.x.allFinite()) return std::nullopt;
    step.inverse_depths.reserve(rays_.size());
    for (int o = 0; o < num_observations(); ++o) {
      const Eigen::Vector3d y = Between(x_, o);
      const double s = inverse_depths_[o];
      const Eigen::Vector3d residual = rays_[o] - s * y;
      const Eigen::Vector3d moved = residual - s * Between(step.x, o);
      const double ds = y.dot(moved) / DampedSquare(y, damping);
      step.inverse_depths.push_back(std::clamp(s + ds, s / kMaxDepthFactor, s * kMaxDepthFactor));
      step.model_gain +=
          0.5 * Weight(residual.norm()) * (residual.squaredNorm() - (moved - ds * y).squaredNorm());
    }
    return step;
  }

  static double DampedSquare(const Eigen::Vector3d& y, double damping) {
    return std::max((1.0 + damping) * y.squaredNorm(), 1e-300);
  }

  MinimaxStructure Structure() const {
    MinimaxStructure structure;
    for (int view = 0; view < layout_.num_views; ++view) {
      structure.center_in_world.push_back(Center(x_, view));
    }
    for (int i = 0; i < layout_.num_points; ++i) {
      structure.point_in_world.emplace_back(x_.segment<3>(layout_.Point(i)));
    }
    return structure;
  }

  const MinimaxProblem& problem_;
  double loss_ = 0.0;  // present scale of the loss, rad
  StructureSystem system_;
  StructureLayout layout_;
  std::vector<Eigen::Vector3d> rays_;   // unit, world axes, by observation
  Eigen::VectorXd x_;                   // centres and points
  std::vector<double> inverse_depths_;  // by observation
  std::vector<Eigen::Matrix3d> S_;      // by observation
};

}  // namespace

std::optional<MinimaxStructure> SolveGlobalPositioning(const MinimaxProblem& problem,
                                                       double loss_rad) {
  CheckProblem(problem);
  if (!(loss_rad > 0.0)) throw std::invalid_argument("global positioning: loss must be above 0");
  if (!problem.view_fixed.empty() || !problem.point_fixed.empty()) {
    throw std::invalid_argument("global positioning: nothing can be held fixed");
  }
  if (problem.num_views() < 2) return std::nullopt;
  return GlobalPositioning(problem).Solve(loss_rad);
}

}  // namespace rotslam
