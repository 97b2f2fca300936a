#include "apps/slam/map/component_alignment.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "apps/slam/map/resect_frames.h"
#include "rotodom/types/median.h"

namespace rotslam {
namespace {

// Frames on each side of a boundary from which scale and place are computed: one second of video.
constexpr int kBoundaryFrames = 30;

using Path = std::vector<std::pair<FrameId, Eigen::Vector3d>>;

// Keyframes within kBoundaryFrames of the last (or first) one, at least two.
Path CentersAtBoundary(const CenterMap& centers, bool at_end) {
  Path path(centers.begin(), centers.end());
  if (at_end) std::reverse(path.begin(), path.end());
  const FrameId boundary = path.front().first;
  const auto is_far = [&](const auto& entry) {
    return std::abs(entry.first.value - boundary.value) > kBoundaryFrames;
  };
  const std::size_t least = std::min<std::size_t>(2, path.size());
  path.erase(std::find_if(path.begin() + static_cast<std::ptrdiff_t>(least), path.end(), is_far),
             path.end());
  return path;
}

// Median speed of the frames before the boundary, in the direction of the step nearest to it.
Eigen::Vector3d VelocityAtBoundary(const CenterMap& centers,
                                   const std::vector<double>& timestamps_s) {
  const Path path = CentersAtBoundary(centers, true);
  std::vector<double> speeds;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  for (std::size_t k = 1; k < path.size(); ++k) {
    const double seconds =
        timestamps_s[path[k - 1].first.value] - timestamps_s[path[k].first.value];
    const Eigen::Vector3d step = path[k - 1].second - path[k].second;
    if (!(seconds > 0.0) || step.norm() == 0.0) continue;
    if (speeds.empty()) direction = step.normalized();
    speeds.push_back(step.norm() / seconds);
  }
  return Median(std::move(speeds)) * direction;
}

// Median distance of the points seen by the keyframes at the boundary; zero where they see none.
double DepthAtBoundary(const Reconstruction& map, const CenterMap& centers, bool at_end) {
  const Path path = CentersAtBoundary(centers, at_end);
  const CenterMap center_at_boundary(path.begin(), path.end());
  std::vector<double> depths;
  for (const Track& track : map.tracks) {
    const auto point = map.point_in_world.find(track.id);
    if (point == map.point_in_world.end()) continue;
    for (const Observation& observation : track.observations) {
      const auto center = center_at_boundary.find(observation.frame);
      if (center != center_at_boundary.end())
        depths.push_back((point->second - center->second).norm());
    }
  }
  return Median(std::move(depths));
}

// Centres of the frames near the boundary between two frames: those of the map, or resected against
// its points.
CenterMap CentersAround(FrameId one,
                        FrameId other,
                        const Reconstruction& map,
                        const AlignmentSources& sources) {
  CenterMap centers;
  std::map<FrameId, ResectionStart> starts;
  const auto begin =
      sources.cam_from_world.lower_bound(FrameId{std::min(one, other).value - kBoundaryFrames});
  const auto end =
      sources.cam_from_world.upper_bound(FrameId{std::max(one, other).value + kBoundaryFrames});
  for (auto entry = begin; entry != end; ++entry) {
    const auto& [frame, rotation] = *entry;
    const auto known = map.center_in_world.find(frame);
    if (known != map.center_in_world.end()) {
      centers.insert(*known);
    } else {
      const auto after = map.center_in_world.lower_bound(frame);
      const auto near = after == map.center_in_world.end() ? std::prev(after) : after;
      starts[frame] = {rotation, near->second, std::nullopt};
    }
  }
  for (const auto& [frame, pose] : ResectFrames(starts,
                                                {map.point_in_world, sources.tracks},
                                                sources.camera,
                                                sources.resection,
                                                sources.num_threads)) {
    centers[frame] = pose.center_in_world;
  }
  return centers;
}

// Translation from `from` to `to`: the median over the frames that have both, for each axis.
std::optional<Eigen::Vector3d> MedianStep(const CenterMap& from, const CenterMap& to) {
  std::array<std::vector<double>, 3> steps;
  for (const auto& [frame, center] : from) {
    const auto other = to.find(frame);
    if (other == to.end()) continue;
    for (int axis = 0; axis < 3; ++axis) {
      steps[axis].push_back(other->second[axis] - center[axis]);
    }
  }
  if (steps[0].empty()) return std::nullopt;
  return Eigen::Vector3d(Median(steps[0]), Median(steps[1]), Median(steps[2]));
}

// Translation from the frame of `from` that is nearest in time to one of `to`, to the position on
// the path `to` at that time.
Eigen::Vector3d StepInTime(const CenterMap& from,
                           const CenterMap& to,
                           const std::vector<double>& timestamps_s) {
  auto nearest = from.begin();
  auto before = to.begin();
  int least = std::numeric_limits<int>::max();
  for (auto own = from.begin(); own != from.end(); ++own) {
    for (auto other = to.begin(); other != to.end(); ++other) {
      const int distance = std::abs(own->first.value - other->first.value);
      if (distance >= least) continue;
      least = distance;
      nearest = own;
      before = other;
    }
  }
  if (to.begin()->first < nearest->first && nearest->first < to.rbegin()->first) {
    return InterpolatedCenter(to, timestamps_s, nearest->first) - nearest->second;
  }
  const double seconds = timestamps_s[nearest->first.value] - timestamps_s[before->first.value];
  return before->second + seconds * VelocityAtBoundary(to, timestamps_s) - nearest->second;
}

}  // namespace

Reconstruction Moved(const Reconstruction& part, const Similarity& similarity) {
  Reconstruction moved = part;
  for (auto& [frame, rotation] : moved.cam_from_world) rotation = similarity.Move(rotation);
  for (auto& [frame, center] : moved.center_in_world) center = similarity.Move(center);
  for (auto& [track, point] : moved.point_in_world) point = similarity.Move(point);
  return moved;
}

Similarity AlignComponent(const Reconstruction& placed,
                          const Reconstruction& part,
                          const AlignmentSources& sources) {
  CenterMap earlier = placed.center_in_world;
  std::erase_if(earlier, [&](const auto& entry) {
    return entry.first >= part.center_in_world.begin()->first;
  });
  // The part may lie before all components placed so far.
  const bool is_behind = !earlier.empty();
  if (!is_behind) earlier = placed.center_in_world;
  const FrameId last = is_behind ? earlier.rbegin()->first : earlier.begin()->first;
  const FrameId first = is_behind ? part.center_in_world.begin()->first
                                  : std::prev(part.center_in_world.lower_bound(last))->first;

  Similarity similarity;
  similarity.turn = sources.cam_from_world.at(first).Inverse() * part.cam_from_world.at(first);
  const double before = DepthAtBoundary(placed, earlier, is_behind);
  const double after = DepthAtBoundary(part, part.center_in_world, !is_behind);
  if (before > 0.0 && after > 0.0) similarity.scale = before / after;

  const Reconstruction scaled = Moved(part, similarity);
  const PureRotationSegment* segment = SegmentAt(sources.segments, first);
  if (segment != nullptr && SegmentAt(sources.segments, last) == segment) {
    similarity.shift = placed.center_in_world.at(last) - scaled.center_in_world.at(first);
    return similarity;
  }
  const CenterMap from = CentersAround(last, first, scaled, sources);
  const CenterMap to = CentersAround(last, first, placed, sources);
  const auto seen = MedianStep(from, to);
  similarity.shift = seen ? *seen : StepInTime(from, to, sources.timestamps_s);
  return similarity;
}

}  // namespace rotslam
