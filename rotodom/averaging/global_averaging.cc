#include "rotodom/averaging/global_averaging.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Cholesky>

#include "rotodom/averaging/consensus_start.h"
#include "rotodom/averaging/edge_system.h"
#include "rotodom/types/options.h"

namespace rotslam {
namespace {

// The L1 stage stops at steps below this: it only computes a start.
constexpr double kL1Step_rad = 1e-3;
// Share of the views that may still change at the end: some have wrong edges only.
constexpr double kUnsettledShare = 0.005;
// Share of the views with mostly contradicting edges at which the L1 stage runs.
constexpr double kInconsistentShare = 0.25;
// Initial scale of the loss of a trusted edge, as a multiple of its residual: nearly quadratic.
// With twice the residual steps would be twice too long.
constexpr double kFirstLoss = 10.0;
// Ratio of an odometry's errors to those from independent edges; its square is the factor 30 by
// which correlated errors increase the variances over 160 frames (AveragingOptions::lasting_share).
constexpr double kOdometryDrift = 5.5;

// Views by position, ascending.
struct Views {
  std::vector<FrameId> ids;
  int PositionOf(FrameId id) const {
    return static_cast<int>(std::lower_bound(ids.begin(), ids.end(), id) - ids.begin());
  }
  int size() const { return static_cast<int>(ids.size()); }
};

// Throws std::invalid_argument when the problem breaks its contract.
void CheckProblem(const GlobalAveragingProblem& problem) {
  for (const FrameId view : problem.held_views) {
    if (!problem.cam_from_world.contains(view)) {
      throw std::invalid_argument("AverageGlobally: a fixed view has no orientation");
    }
  }
  for (const RelativeRotation& edge : problem.edges) {
    const std::string name = std::to_string(edge.i.value) + "-" + std::to_string(edge.j.value);
    if (edge.i == edge.j) {
      throw std::invalid_argument("AverageGlobally: edge " + name + " joins a view with itself");
    }
    if (!edge.covariance.allFinite() ||
        Eigen::LLT<Eigen::Matrix3d>(edge.covariance).info() != Eigen::Success) {
      throw std::invalid_argument("AverageGlobally: the covariance of edge " + name +
                                  " is not positive definite");
    }
  }
}

Views ViewsOf(const GlobalAveragingProblem& problem) {
  Views views;
  views.ids.assign(problem.held_views.begin(), problem.held_views.end());
  views.ids.reserve(views.ids.size() + 2 * problem.edges.size());
  for (const RelativeRotation& edge : problem.edges) {
    views.ids.push_back(edge.i);
    views.ids.push_back(edge.j);
  }
  std::sort(views.ids.begin(), views.ids.end());
  views.ids.erase(std::unique(views.ids.begin(), views.ids.end()), views.ids.end());
  return views;
}

std::vector<ConsensusEdge> ConsensusEdges(const GlobalAveragingProblem& problem,
                                          const Views& views,
                                          const GlobalAveragingOptions& options) {
  std::vector<ConsensusEdge> edges;
  edges.reserve(problem.edges.size());
  for (const RelativeRotation& edge : problem.edges) {
    edges.push_back({views.PositionOf(edge.i),
                     views.PositionOf(edge.j),
                     edge.j_from_i.Quaternion(),
                     ErrorCovariance(edge, options).trace() / 3.0});
  }
  return edges;
}

ConsensusStart FindStart(const GlobalAveragingProblem& problem,
                         const Views& views,
                         const std::vector<ConsensusEdge>& edges,
                         const GlobalAveragingOptions& options,
                         int num_threads) {
  ConsensusProblem consensus;
  consensus.num_views = views.size();
  consensus.edges = edges;
  consensus.has_start = problem.use_start;
  consensus.trust_sigmas = options.trust_sigmas;
  consensus.drift_factor = options.drift_factor;
  consensus.seed = options.seed;
  consensus.cam_from_world.resize(views.ids.size(), Eigen::Quaterniond::Identity());
  consensus.is_held.resize(views.ids.size(), 0);
  for (int k = 0; k < views.size(); ++k) {
    consensus.is_held[k] = problem.held_views.contains(views.ids[k]) ? 1 : 0;
    const auto given = problem.cam_from_world.find(views.ids[k]);
    if (given == problem.cam_from_world.end()) {
      consensus.has_start = false;
    } else {
      consensus.cam_from_world[k] = given->second.Quaternion();
    }
  }
  return FindConsensusStart(consensus, num_threads);
}

// In components without a fixed view, the first view gets the orientation given for it, or the
// identity. The solver had fixed another view, since the first one may have only a few unreliable
// edges.
void FixGauge(const GlobalAveragingProblem& problem, GlobalAveragingResult& result) {
  std::vector<char> is_free(result.component_sizes.size(), 1);
  for (const FrameId view : problem.held_views) is_free[result.component.at(view)] = 0;
  std::vector<Rotation> world_from_goal;
  for (auto& [view, cam_from_world] : result.cam_from_world) {
    const int component = result.component.at(view);
    if (component == static_cast<int>(world_from_goal.size())) {
      const auto given = problem.cam_from_world.find(view);
      const Rotation goal = given == problem.cam_from_world.end() ? Rotation() : given->second;
      world_from_goal.push_back(cam_from_world.Inverse() * goal);
    }
    if (is_free[component] != 0) cam_from_world = cam_from_world * world_from_goal[component];
  }
}

// The solver's system: its free views first.
struct Assembly {
  EdgeSystem system;
  std::vector<int> slot;  // of a view in the system
};

Assembly Assemble(const GlobalAveragingProblem& problem,
                  const std::vector<ConsensusEdge>& edges,
                  const ConsensusStart& start,
                  const GlobalAveragingOptions& options,
                  int num_threads) {
  std::vector<char> is_held(start.component.size(), 0);
  for (const int root : start.roots) is_held[root] = 1;
  std::vector<int> slot(is_held.size());
  std::vector<Eigen::Quaterniond> orientations;
  orientations.reserve(is_held.size());
  int num_free = 0;
  for (const bool held : {false, true}) {
    for (std::size_t k = 0; k < is_held.size(); ++k) {
      if ((is_held[k] != 0) != held) continue;
      slot[k] = static_cast<int>(orientations.size());
      orientations.push_back(start.cam_from_world[k]);
    }
    if (!held) num_free = static_cast<int>(orientations.size());
  }
  EdgeSystem system(std::move(orientations), num_free, options.loss_sigmas, num_threads);
  system.Reserve(edges.size());
  for (std::size_t k = 0; k < edges.size(); ++k) {
    system.AddEdge(slot[edges[k].i],
                   slot[edges[k].j],
                   problem.edges[k].j_from_i,
                   ErrorCovariance(problem.edges[k], options));
  }
  return {std::move(system), std::move(slot)};
}

double Sigmas(const EdgeSystem::Term& term) {
  return std::sqrt(std::max(0.0, term.residual.dot(term.information * term.residual)));
}

void Minimize(EdgeSystem& system,
              const std::vector<char>& is_trusted,
              const GlobalAveragingOptions& options,
              GlobalAveragingResult& result) {
  result.has_converged = system.num_free() == 0;
  if (result.has_converged) return;
  std::vector<double> loss(is_trusted.size(), options.loss_sigmas);
  for (std::size_t k = 0; k < loss.size(); ++k) {
    if (is_trusted[k] == 0) continue;
    loss[k] = std::max(loss[k], kFirstLoss * Sigmas(system.terms()[k]));
    system.SetLossSigmas(static_cast<int>(k), loss[k]);
  }
  system.Linearize();
  if (system.CountInconsistentViews() > kInconsistentShare * system.num_free()) {
    for (int iteration = 0; iteration < options.l1_iterations; ++iteration) {
      ++result.iterations;
      if (system.Step(EdgeLoss::kL1) < kL1Step_rad) break;
    }
  }
  for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
    ++result.iterations;
    if (system.Step() < 0.0) return;
    bool has_shrunk = false;
    for (std::size_t k = 0; k < loss.size(); ++k) {
      if (loss[k] <= options.loss_sigmas) continue;
      loss[k] = std::max(options.loss_sigmas, options.loss_decay * loss[k]);
      system.SetLossSigmas(static_cast<int>(k), loss[k]);
      has_shrunk = true;
    }
    result.has_converged =
        !has_shrunk && system.AgreedTurn(kUnsettledShare) < options.min_step_deg * kRadFromDeg;
    if (result.has_converged) return;
  }
}

void Report(const EdgeSystem& system,
            const GlobalAveragingOptions& options,
            GlobalAveragingResult& result) {
  const double squared_loss = options.loss_sigmas * options.loss_sigmas;
  result.angle_rad.reserve(system.terms().size());
  result.sigmas.reserve(system.terms().size());
  for (const EdgeSystem::Term& term : system.terms()) {
    const double sigmas = Sigmas(term);
    result.angle_rad.push_back(term.residual.norm());
    result.sigmas.push_back(sigmas);
    result.cost += squared_loss * sigmas * sigmas / (squared_loss + sigmas * sigmas);
    result.num_inliers += sigmas <= options.loss_sigmas ? 1 : 0;
  }
}

}  // namespace

std::optional<std::string> GlobalAveragingOptions::Problem() const {
  if (!(edge_floor_deg >= 0.0)) {
    return OutOfRange("edge_floor_deg", edge_floor_deg, "zero or more");
  }
  if (!(error_factor > 0.0)) return OutOfRange("error_factor", error_factor, "positive");
  if (!(loss_sigmas > 0.0)) return OutOfRange("loss_sigmas", loss_sigmas, "positive");
  if (!(trust_sigmas > 0.0)) return OutOfRange("trust_sigmas", trust_sigmas, "positive");
  if (!(drift_factor >= 1.0)) return OutOfRange("drift_factor", drift_factor, "at least 1");
  if (!(loss_decay > 0.0 && loss_decay < 1.0)) {
    return OutOfRange("loss_decay", loss_decay, "between 0 and 1");
  }
  if (l1_iterations < 0) return OutOfRange("l1_iterations", l1_iterations, "zero or more");
  if (!(min_step_deg > 0.0)) return OutOfRange("min_step_deg", min_step_deg, "positive");
  if (max_iterations < 1) return OutOfRange("max_iterations", max_iterations, "at least 1");
  return std::nullopt;
}

Eigen::Matrix3d ErrorCovariance(const RelativeRotation& edge,
                                const GlobalAveragingOptions& options) {
  const double floor_rad = options.edge_floor_deg * kRadFromDeg;
  return options.error_factor * options.error_factor * edge.covariance +
         floor_rad * floor_rad * Eigen::Matrix3d::Identity();
}

void ReportEdges(std::span<const RelativeRotation> edges,
                 const GlobalAveragingOptions& options,
                 GlobalAveragingResult& result) {
  const double squared_loss = options.loss_sigmas * options.loss_sigmas;
  result.angle_rad.clear();
  result.sigmas.clear();
  result.cost = 0.0;
  result.num_inliers = 0;
  for (const RelativeRotation& edge : edges) {
    // The error delta in Exp(delta) * j_from_i, in the frame of camera j.
    const Eigen::Vector3d delta =
        (result.cam_from_world.at(edge.j) * result.cam_from_world.at(edge.i).Inverse() *
         edge.j_from_i.Inverse())
            .Log();
    const double squared =
        std::max(0.0, delta.dot(ErrorCovariance(edge, options).llt().solve(delta)));
    result.angle_rad.push_back(delta.norm());
    result.sigmas.push_back(std::sqrt(squared));
    result.cost += squared_loss * squared / (squared_loss + squared);
    result.num_inliers += result.sigmas.back() <= options.loss_sigmas ? 1 : 0;
  }
}

GlobalAveragingResult AverageGlobally(const GlobalAveragingProblem& problem,
                                      const GlobalAveragingOptions& options,
                                      int num_threads) {
  if (const auto found = options.Problem()) {
    throw std::invalid_argument("GlobalAveragingOptions: " + *found);
  }
  CheckProblem(problem);
  const Views views = ViewsOf(problem);
  const std::vector<ConsensusEdge> edges = ConsensusEdges(problem, views, options);
  const ConsensusStart start = FindStart(problem, views, edges, options, num_threads);
  Assembly assembly = Assemble(problem, edges, start, options, num_threads);

  GlobalAveragingResult result;
  assembly.system.Linearize();
  Minimize(assembly.system, start.is_trusted, options, result);
  assembly.system.Linearize();
  Report(assembly.system, options, result);
  for (int k = 0; k < views.size(); ++k) {
    const int component = start.component[k];
    result.component.emplace_hint(result.component.end(), views.ids[k], component);
    if (component == static_cast<int>(result.component_sizes.size())) {
      result.component_sizes.push_back(0);
    }
    ++result.component_sizes[component];
    result.cam_from_world.emplace_hint(
        result.cam_from_world.end(), views.ids[k], assembly.system.CamFromWorld(assembly.slot[k]));
  }
  FixGauge(problem, result);
  return result;
}

GlobalAveragingResult CloseLoops(std::span<const RelativeRotation> edges,
                                 const RotationMap& cam_from_world,
                                 const AveragingOptions& options,
                                 int num_threads) {
  if (const auto found = options.Problem()) {
    throw std::invalid_argument("AveragingOptions: " + *found);
  }
  GlobalAveragingProblem problem;
  problem.edges = edges;
  problem.cam_from_world = cam_from_world;
  if (!cam_from_world.empty()) problem.held_views = {cam_from_world.begin()->first};
  GlobalAveragingOptions global;
  global.edge_floor_deg = options.edge_floor_deg;
  global.loss_sigmas = options.loss_sigmas;
  global.min_step_deg = options.min_step_deg;
  global.drift_factor = options.edge_error_factor * kOdometryDrift;
  return AverageGlobally(problem, global, num_threads);
}

}  // namespace rotslam
