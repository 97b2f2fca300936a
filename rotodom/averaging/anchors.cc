#include "rotodom/averaging/anchors.h"

#include <functional>
#include <iterator>
#include <queue>
#include <stdexcept>
#include <utility>
#include <vector>

namespace rotslam {

RotationMap FollowAnchors(const ViewGraph& graph,
                          const RotationMap& cam_from_world,
                          const RotationMap& refined,
                          const AveragingOptions& options) {
  if (refined.empty()) throw std::invalid_argument("FollowAnchors: no view is refined");
  const auto turn = [&](RotationMap::const_iterator anchor) {
    return cam_from_world.at(anchor->first).Inverse() * anchor->second;
  };
  RotationMap following = refined;
  std::set<FrameId> free_views;
  for (const auto& [view, rotation] : cam_from_world) {
    const auto after = refined.lower_bound(view);
    if (after != refined.end() && after->first == view) continue;
    free_views.insert(view);
    if (after == refined.begin()) {
      following[view] = rotation * turn(after);
      continue;
    }
    const auto before = std::prev(after);
    if (after == refined.end()) {
      following[view] = rotation * turn(before);
      continue;
    }
    const double weight = static_cast<double>(view.value - before->first.value) /
                          (after->first.value - before->first.value);
    following[view] = rotation * Interpolate(turn(before), turn(after), weight);
  }
  for (const auto& [view, rotation] : AverageRotations(graph, following, free_views, options)) {
    following[view] = rotation;
  }
  return following;
}

std::map<FrameId, Eigen::Matrix3d> AnchorCovariances(const ViewGraph& graph,
                                                     const RotationMap& cam_from_world,
                                                     const std::set<FrameId>& anchors,
                                                     const AveragingOptions& options) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("AveragingOptions: " + *problem);
  }
  std::map<FrameId, Eigen::Matrix3d> covariances;
  std::set<FrameId> done;
  using Entry = std::pair<double, FrameId>;  // trace
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  for (const FrameId anchor : anchors) {
    if (!cam_from_world.contains(anchor)) continue;
    covariances[anchor] = Eigen::Matrix3d::Zero();
    queue.emplace(0.0, anchor);
  }
  const double factor = options.edge_error_factor * options.edge_error_factor;
  const double floor_rad = options.edge_floor_deg * kRadFromDeg;
  const Eigen::Matrix3d floor = floor_rad * floor_rad * Eigen::Matrix3d::Identity();
  while (!queue.empty()) {
    const FrameId i = queue.top().second;
    queue.pop();
    if (!done.insert(i).second) continue;
    for (const int index : graph.EdgesOf(i)) {
      const RelativeRotation& stored = graph.edges()[index];
      const RelativeRotation edge = stored.i == i ? stored : Flipped(stored);
      const auto rotation = cam_from_world.find(edge.j);
      if (rotation == cam_from_world.end() || done.contains(edge.j)) continue;
      const Rotation j_from_i = rotation->second * cam_from_world.at(i).Inverse();
      const Eigen::Vector3d residual = (j_from_i * edge.j_from_i.Inverse()).Log();
      const Eigen::Matrix3d R_j_i = j_from_i.Matrix();
      const Eigen::Matrix3d covariance = R_j_i * covariances.at(i) * R_j_i.transpose() +
                                         factor * edge.covariance + floor +
                                         residual * residual.transpose();
      const auto known = covariances.find(edge.j);
      if (known != covariances.end() && known->second.trace() <= covariance.trace()) continue;
      covariances[edge.j] = covariance;
      queue.emplace(covariance.trace(), edge.j);
    }
  }
  for (const FrameId anchor : anchors) covariances.erase(anchor);
  return covariances;
}

}  // namespace rotslam
