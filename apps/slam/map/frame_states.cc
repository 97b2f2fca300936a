#include "apps/slam/map/frame_states.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include "apps/slam/map/path_growth.h"
#include "rotodom/types/disjoint_sets.h"

namespace rotslam {
namespace {

std::map<FrameId, int> ComponentOfKeyframes(const std::vector<MapComponent>& components) {
  std::map<FrameId, int> component_of;
  for (int k = 0; k < std::ssize(components); ++k) {
    for (const FrameId frame : components[k].keyframes) component_of[frame] = k;
  }
  return component_of;
}

// The component of most points that each frame sees; frames that see none are missing.
std::map<FrameId, int> ComponentBySeenPoints(const PoseSources& sources,
                                             const std::map<FrameId, int>& of_keyframe) {
  std::map<TrackId, int> of_point;
  for (const Track& track : sources.map.tracks) {
    if (!sources.map.point_in_world.contains(track.id)) continue;
    for (const Observation& observation : track.observations) {
      const auto component = of_keyframe.find(observation.frame);
      if (component != of_keyframe.end()) of_point[track.id] = component->second;
    }
  }
  std::map<FrameId, std::map<int, int>> votes;
  for (const Track& track : sources.tracks) {
    const auto component = of_point.find(track.id);
    if (component == of_point.end()) continue;
    for (const Observation& observation : track.observations) {
      ++votes[observation.frame][component->second];
    }
  }
  std::map<FrameId, int> component_of;
  for (const auto& [frame, count] : votes) {
    component_of[frame] =
        std::max_element(count.begin(), count.end(), [](const auto& a, const auto& b) {
          return a.second < b.second;
        })->first;
  }
  return component_of;
}

// Residuals tell how good keypoints are better than their sigmas do.
Eigen::Vector3d SigmaOf(const ResectedPose& pose) {
  return std::sqrt(pose.variance_factor) *
         pose.covariance.bottomRightCorner<3, 3>().diagonal().cwiseMax(0.0).cwiseSqrt();
}

// Fills the states of all frames: first those with a position of their own, then the others.
class StateFinder {
 public:
  StateFinder(const PoseSources& sources, const Registration& registration)
      : sources_(sources), registration_(registration) {
    for (const RelativeRotation& edge : sources.graph.edges()) {
      pieces_.Join(edge.i.value, edge.j.value);
    }
  }

  std::map<FrameId, FramePose> Find() {
    FindMeasured();
    AddDrift();
    FindHeld();
    placed_ = poses_;
    GrowthByComponent();
    for (const auto& [frame, center] : sources_.center_in_world) {
      if (!placed_.contains(frame)) poses_[frame] = BetweenPlaced(frame);
    }
    for (const auto& [frame, note] : registration_.notes) poses_.at(frame).note = note;
    return std::move(poses_);
  }

 private:
  using Placed = std::map<FrameId, FramePose>::const_iterator;

  void FindMeasured() {
    const std::map<FrameId, int> of_keyframe = ComponentOfKeyframes(sources_.components);
    const std::map<FrameId, int> by_points = sources_.components.size() > 1
                                                 ? ComponentBySeenPoints(sources_, of_keyframe)
                                                 : std::map<FrameId, int>();
    for (const auto& [frame, center] : sources_.map.center_in_world) {
      FramePose& pose = poses_[frame];
      pose.state = PoseState::kMeasured;
      const auto component = of_keyframe.find(frame);
      pose.component = component == of_keyframe.end() ? 0 : component->second;
    }
    for (const auto& [frame, measured] : registration_.measured) {
      const bool is_keyframe = poses_.contains(frame);
      FramePose& pose = poses_[frame];
      pose.state =
          registration_.held_orientations.contains(frame) ? PoseState::kHeld : PoseState::kMeasured;
      pose.position_sigma = std::sqrt(sources_.variance_factor) * SigmaOf(measured);
      if (is_keyframe) continue;
      const auto component = by_points.find(frame);
      pose.component = component == by_points.end() ? 0 : component->second;
    }
  }

  // The distance from the first frame of the component times the deviation of the orientation,
  // evenly over the axes: scales drift with the orientations.
  void AddDrift() {
    std::map<int, Eigen::Vector3d> first_center;
    for (auto& [frame, pose] : poses_) {
      const Eigen::Vector3d& center = sources_.center_in_world.at(frame);
      const Eigen::Vector3d& first = first_center.emplace(pose.component, center).first->second;
      const auto sigma = sources_.orientation_sigma.find(frame);
      if (!pose.position_sigma || sigma == sources_.orientation_sigma.end()) continue;
      const double drift = sigma->second * (center - first).norm();
      const Eigen::Vector3d variance =
          pose.position_sigma->cwiseAbs2() + Eigen::Vector3d::Constant(drift * drift / 3.0);
      pose.position_sigma = variance.cwiseSqrt();
    }
  }

  void FindHeld() {
    for (const auto& [frame, keyframe] : registration_.shared_center) {
      FramePose& pose = poses_[frame];
      pose = poses_.at(keyframe);
      pose.state = PoseState::kHeld;
      pose.note = "position of a pure rotation";
    }
  }

  void GrowthByComponent() {
    std::map<int, CenterMap> centers;
    for (const auto& [frame, pose] : placed_) {
      centers[pose.component][frame] = sources_.center_in_world.at(frame);
    }
    for (const auto& [component, path] : centers) {
      growth_.emplace(component, PathGrowth(path, sources_.timestamps_s));
    }
  }

  bool IsTied(FrameId frame, FrameId other) {
    return pieces_.Find(frame.value) == pieces_.Find(other.value);
  }

  double SecondsBetween(FrameId frame, FrameId other) const {
    return std::abs(sources_.timestamps_s[frame.value] - sources_.timestamps_s[other.value]);
  }

  FramePose BetweenPlaced(FrameId frame) {
    const Placed after = placed_.lower_bound(frame);
    const bool has_after = after != placed_.end();
    const bool has_before = after != placed_.begin();
    if (has_before && has_after) return Interpolated(frame, std::prev(after), after);
    if (has_before) return Extrapolated(frame, std::prev(after));
    if (has_after) return Extrapolated(frame, after);
    return {};
  }

  FramePose Interpolated(FrameId frame, Placed before, Placed after) {
    FramePose pose;
    if (before->second.component != after->second.component) {
      pose.note = "between parts of the map that nothing ties";
      return pose;
    }
    const bool has_edges = !sources_.graph.EdgesOf(frame).empty();
    if (has_edges && !IsTied(frame, before->first) && !IsTied(frame, after->first)) {
      pose.note = "matches no frame of the map";
      return pose;
    }
    pose.state = PoseState::kInterpolated;
    pose.component = before->second.component;
    if (!has_edges) pose.note = "orientation interpolated too";
    const double before_s = SecondsBetween(frame, before->first);
    const double after_s = SecondsBetween(frame, after->first);
    const double growth = growth_.at(pose.component).OfInterpolation(before_s, after_s);
    if (!before->second.position_sigma || !after->second.position_sigma || !(growth > 0.0)) {
      return pose;
    }
    const double weight = before_s + after_s > 0.0 ? before_s / (before_s + after_s) : 0.5;
    const Eigen::Vector3d variance = (1.0 - weight) * before->second.position_sigma->cwiseAbs2() +
                                     weight * after->second.position_sigma->cwiseAbs2() +
                                     Eigen::Vector3d::Constant(growth * growth);
    pose.position_sigma = variance.cwiseSqrt();
    return pose;
  }

  FramePose Extrapolated(FrameId frame, Placed nearest) {
    FramePose pose;
    if (!IsTied(frame, nearest->first)) {
      pose.note = "matches no frame of the map";
      return pose;
    }
    pose.state = PoseState::kExtrapolated;
    pose.component = nearest->second.component;
    const double growth =
        growth_.at(pose.component).OfHolding(SecondsBetween(frame, nearest->first));
    if (!nearest->second.position_sigma || !(growth > 0.0)) return pose;
    const Eigen::Vector3d variance =
        nearest->second.position_sigma->cwiseAbs2() + Eigen::Vector3d::Constant(growth * growth);
    pose.position_sigma = variance.cwiseSqrt();
    return pose;
  }

  const PoseSources& sources_;
  const Registration& registration_;
  DisjointSets pieces_;  // of the view-graph
  std::map<FrameId, FramePose> poses_;
  std::map<FrameId, FramePose> placed_;  // with a position of their own
  std::map<int, PathGrowth> growth_;     // by component
};

}  // namespace

std::map<FrameId, FramePose> FindFramePoses(const PoseSources& sources,
                                            const Registration& registration) {
  return StateFinder(sources, registration).Find();
}

}  // namespace rotslam
