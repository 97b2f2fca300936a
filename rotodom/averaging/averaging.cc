#include "rotodom/averaging/averaging.h"

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <vector>

#include "rotodom/averaging/edge_system.h"
#include "rotodom/types/options.h"

namespace rotslam {
namespace {

// The L1 stage stops at steps below this, rad: it only computes a start.
constexpr double kL1Step = 1e-3;

// Position in an ascending list, -1 when it is not there.
int PositionIn(const std::vector<FrameId>& views, FrameId view) {
  const auto found = std::lower_bound(views.begin(), views.end(), view);
  return found == views.end() || *found != view ? -1 : static_cast<int>(found - views.begin());
}

Eigen::Matrix3d WithFloor(const Eigen::Matrix3d& covariance, const AveragingOptions& options) {
  const double floor_rad = options.edge_floor_deg * kRadFromDeg;
  return covariance + floor_rad * floor_rad * Eigen::Matrix3d::Identity();
}

// Edges with a free view, each once: those between two free views are listed at the later one.
std::vector<const RelativeRotation*> EdgesAt(const ViewGraph& graph,
                                             const std::vector<FrameId>& free) {
  std::vector<const RelativeRotation*> edges;
  edges.reserve(6 * free.size());
  for (const FrameId view : free) {
    for (const int index : graph.EdgesOf(view)) {
      const RelativeRotation& edge = graph.edges()[index];
      if (view == edge.j || PositionIn(free, edge.j) < 0) edges.push_back(&edge);
    }
  }
  return edges;
}

// Views of `edges` that are not free and have an orientation.
std::vector<FrameId> FixedViewsOf(const std::vector<const RelativeRotation*>& edges,
                                  const std::vector<FrameId>& free,
                                  const RotationMap& cam_from_world) {
  std::vector<FrameId> fixed;
  for (const RelativeRotation* edge : edges) {
    if (PositionIn(free, edge->i) < 0) fixed.push_back(edge->i);
    if (PositionIn(free, edge->j) < 0) fixed.push_back(edge->j);
  }
  std::sort(fixed.begin(), fixed.end());
  fixed.erase(std::unique(fixed.begin(), fixed.end()), fixed.end());
  std::erase_if(fixed, [&](FrameId view) { return !cam_from_world.contains(view); });
  return fixed;
}

// The robust least-squares problem; the free views come first in its list.
EdgeSystem MakeSystem(const std::vector<const RelativeRotation*>& edges,
                      const std::vector<FrameId>& free,
                      const std::vector<FrameId>& fixed,
                      const RotationMap& cam_from_world,
                      const AveragingOptions& options) {
  std::vector<Eigen::Quaterniond> orientations;
  orientations.reserve(free.size() + fixed.size());
  for (const FrameId view : free) orientations.push_back(cam_from_world.at(view).Quaternion());
  for (const FrameId view : fixed) orientations.push_back(cam_from_world.at(view).Quaternion());
  const int num_free = static_cast<int>(free.size());
  EdgeSystem system(std::move(orientations), num_free, options.loss_sigmas);
  const auto position = [&](FrameId view) {
    if (const int among_free = PositionIn(free, view); among_free >= 0) return among_free;
    const int among_fixed = PositionIn(fixed, view);
    return among_fixed < 0 ? -1 : num_free + among_fixed;
  };
  system.Reserve(edges.size());
  for (const RelativeRotation* edge : edges) {
    const int i = position(edge->i);
    const int j = position(edge->j);
    if (i < 0 || j < 0 || std::min(i, j) >= num_free) continue;
    system.AddEdge(i, j, edge->j_from_i, WithFloor(edge->covariance, options));
  }
  return system;
}

}  // namespace

std::span<const char* const> OptionWords(AveragingMode) {
  static constexpr const char* kWords[] = {"off", "window", "global"};
  return kWords;
}

std::optional<std::string> AveragingOptions::Problem() const {
  if (window < 1) return OutOfRange("window", window, "at least 1");
  if (!(edge_floor_deg > 0.0)) return OutOfRange("edge_floor_deg", edge_floor_deg, "positive");
  if (!(edge_error_factor > 0.0)) {
    return OutOfRange("edge_error_factor", edge_error_factor, "positive");
  }
  if (!(lasting_share >= 0.0 && lasting_share <= 1.0)) {
    return OutOfRange("lasting_share", lasting_share, "from 0 to 1");
  }
  if (!(lasting_views > 0.0)) return OutOfRange("lasting_views", lasting_views, "positive");
  if (!(shared_noise >= 0.0 && shared_noise <= 1.0)) {
    return OutOfRange("shared_noise", shared_noise, "0 to 1");
  }
  if (!(loss_sigmas > 0.0)) return OutOfRange("loss_sigmas", loss_sigmas, "positive");
  if (l1_iterations < 0) return OutOfRange("l1_iterations", l1_iterations, "zero or more");
  if (!(min_step_deg > 0.0)) return OutOfRange("min_step_deg", min_step_deg, "positive");
  if (max_iterations < 1) return OutOfRange("max_iterations", max_iterations, "at least 1");
  return std::nullopt;
}

std::set<FrameId> ViewsToAverage(const RotationMap& cam_from_world,
                                 const AveragingOptions& options) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("AveragingOptions: " + *problem);
  }
  std::set<FrameId> views;
  if (options.mode == AveragingMode::kOff || cam_from_world.empty()) return views;
  const auto first = cam_from_world.begin();
  for (auto entry = std::prev(cam_from_world.end()); entry != first; --entry) {
    if (options.mode == AveragingMode::kWindow && static_cast<int>(views.size()) == options.window)
      break;
    views.insert(views.begin(), entry->first);
  }
  return views;
}

RotationMap AverageRotations(const ViewGraph& graph,
                             const RotationMap& cam_from_world,
                             const std::set<FrameId>& free_views,
                             const AveragingOptions& options) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("AveragingOptions: " + *problem);
  }
  RotationMap averaged;
  for (const FrameId view : free_views) {
    const auto start = cam_from_world.find(view);
    if (start == cam_from_world.end()) {
      throw std::invalid_argument("AverageRotations: a free view has no start");
    }
    averaged.emplace_hint(averaged.end(), *start);
  }
  std::vector<FrameId> free(free_views.begin(), free_views.end());
  const std::vector<const RelativeRotation*> edges = EdgesAt(graph, free);
  std::vector<FrameId> fixed = FixedViewsOf(edges, free, cam_from_world);
  if (fixed.empty() && !free.empty()) {
    fixed.push_back(free.front());
    free.erase(free.begin());
  }
  EdgeSystem system = MakeSystem(edges, free, fixed, cam_from_world, options);
  if (system.terms().empty()) return averaged;
  system.Linearize();
  if (system.CountInconsistentViews() > 0) {
    for (int iteration = 0; iteration < options.l1_iterations; ++iteration) {
      if (system.Step(EdgeLoss::kL1) < kL1Step) break;
    }
  }
  for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
    const double turn = system.Step();
    if (turn < options.min_step_deg * kRadFromDeg) break;
  }
  for (int k = 0; k < static_cast<int>(free.size()); ++k) {
    averaged.at(free[k]) = system.CamFromWorld(k);
  }
  return averaged;
}

std::map<FrameId, int> CountInlierEdges(const ViewGraph& graph,
                                        const RotationMap& cam_from_world,
                                        const AveragingOptions& options) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("AveragingOptions: " + *problem);
  }
  std::map<FrameId, int> counts;
  for (const auto& [view, rotation] : cam_from_world) counts.emplace_hint(counts.end(), view, 0);
  for (const RelativeRotation& edge : graph.edges()) {
    const auto i = cam_from_world.find(edge.i);
    const auto j = cam_from_world.find(edge.j);
    if (i == cam_from_world.end() || j == cam_from_world.end()) continue;
    const Rotation predicted = j->second * i->second.Inverse();
    const Eigen::Vector3d residual = (predicted * edge.j_from_i.Inverse()).Log();
    const Eigen::Matrix3d information = WithFloor(edge.covariance, options).inverse();
    if (residual.dot(information * residual) > options.loss_sigmas * options.loss_sigmas) continue;
    ++counts.at(edge.i);
    ++counts.at(edge.j);
  }
  return counts;
}

}  // namespace rotslam
