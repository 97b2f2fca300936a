#include "apps/slam/map_correction/frame_finder.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "apps/slam/map_correction/absolute_pose.h"
#include "rotodom/features/view.h"
#include "rotodom/types/median.h"

namespace rotslam {
namespace {

// Neighbours see at least this many points in common.
constexpr int kMinCommonPoints = 15;
// Neighbours of the match whose points are used as well.
constexpr int kMaxNeighbours = 4;
// A pose explains what it puts nearer to its corner than this: twice what bundle adjustment ends
// with (BundleOptions::fine), since corners are found at whole pixels of their level.
constexpr double kMaxErrorPx = 4.0;
// A frame is displaced where another pose explains this many more than its present one, in standard
// deviations of such a count, the square root of it. Chance exceeds four once in 30,000 frames.
constexpr double kMinGainSigmas = 4.0;

}  // namespace

FrameFinder::FrameFinder(const std::vector<const Reconstruction*>& maps,
                         PlaceMatches& places,
                         const Camera& camera,
                         const RelocalisationOptions& options,
                         std::uint64_t seed)
    : maps_(maps), places_(places), camera_(camera), options_(options), seed_(seed) {
  for (int k = 0; k < std::ssize(maps); ++k) {
    for (const auto& [frame, center] : maps[k]->center_in_world) {
      if (maps[k]->cam_from_world.contains(frame)) map_of_[frame] = k;
    }
    for (const Track& track : maps[k]->tracks) {
      if (!maps[k]->point_in_world.contains(track.id)) continue;
      for (const Observation& observation : track.observations) {
        seen_[observation.frame].push_back(
            {track.id, maps[k]->point_in_world.at(track.id), observation.keypoint_px});
        points_[observation.frame].push_back(track.id);
      }
    }
  }
  for (auto& [frame, points] : points_) std::sort(points.begin(), points.end());
}

int FrameFinder::CountCommon(FrameId a, FrameId b) const {
  if (MapOf(a) != MapOf(b)) return 0;
  return CountCommonTracks(PointsOf(a), PointsOf(b));
}

std::map<FrameId, std::vector<PointObservation2D3D>> FrameFinder::PointsOfTracks(
    const std::vector<Track>& tracks) const {
  std::vector<std::map<TrackId, std::vector<FrameId>>> seers(maps_.size());
  for (const auto& [frame, points] : points_) {
    for (const TrackId track : points) seers[MapOf(frame)][track].push_back(frame);
  }
  std::map<FrameId, std::vector<PointObservation2D3D>> known;
  for (const Track& track : tracks) {
    for (const Observation& observation : track.observations) {
      const auto map = map_of_.find(observation.frame);
      if (map == map_of_.end()) continue;
      const auto frames = seers[map->second].find(track.id);
      if (frames == seers[map->second].end()) continue;
      const std::vector<FrameId>& others = frames->second;
      const auto num_others =
          std::ssize(others) - std::count(others.begin(), others.end(), observation.frame);
      if (num_others < 2) continue;
      known[observation.frame].push_back(
          {track.id, maps_[map->second]->point_in_world.at(track.id), observation.keypoint_px});
    }
  }
  return known;
}

const std::vector<TrackId>& FrameFinder::PointsOf(FrameId frame) const {
  static const std::vector<TrackId> kNone;
  const auto points = points_.find(frame);
  return points == points_.end() ? kNone : points->second;
}

bool FrameFinder::IsOpen(const Lookalike& pair) const {
  const auto is_known = [&](FrameId frame) {
    return map_of_.contains(frame) && places_.places().contains(frame);
  };
  return is_known(pair.frame) && is_known(pair.match);
}

std::optional<FoundFrame> FrameFinder::Find(const Lookalike& pair) const {
  std::vector<PointObservation2D3D> recognised;
  const auto is_clear = [](const std::optional<FoundFrame>& found) {
    return found && (found->is_displaced || found->is_right);
  };
  Recognise(pair.frame, pair.match, recognised);
  std::optional<FoundFrame> found = FindPose(pair.frame, MapOf(pair.match), recognised);
  if (!is_clear(found)) {
    const std::size_t num_of_match = recognised.size();
    for (const FrameId neighbour : NeighboursOf(pair.match)) {
      if (neighbour != pair.frame) Recognise(pair.frame, neighbour, recognised);
    }
    std::optional<FoundFrame> by_more;
    if (recognised.size() > num_of_match) {
      by_more = FindPose(pair.frame, MapOf(pair.match), recognised);
    }
    if (is_clear(by_more)) {
      found = std::move(by_more);
      found->by_neighbours = true;
    }
  }
  if (!found || !(found->is_displaced || found->is_near)) return std::nullopt;
  found->match = pair.match;
  return found;
}

std::optional<FoundFrame> FrameFinder::FindByTracks(
    FrameId frame, const std::vector<PointObservation2D3D>& points) const {
  // Largest share of the inliers of the found pose that the present pose may explain. The tracks
  // that caused a wrong pose are among those tested, so more than that is no contradiction.
  constexpr double kMaxPresentShare = 0.5;
  std::optional<FoundFrame> found = FindPose(frame, MapOf(frame), points);
  if (!found || !found->is_displaced) return std::nullopt;
  if (found->num_present > kMaxPresentShare * found->num_inliers) return std::nullopt;
  return found;
}

std::vector<FrameId> FrameFinder::NeighboursOf(FrameId frame) const {
  std::vector<std::pair<int, FrameId>> common;
  for (const auto& [other, features] : places_.places()) {
    if (other == frame || !map_of_.contains(other)) continue;
    const int count = CountCommon(frame, other);
    if (count >= kMinCommonPoints) common.emplace_back(-count, other);
  }
  std::sort(common.begin(), common.end());
  std::vector<FrameId> neighbours;
  for (const auto& [count, other] : common) {
    if (std::ssize(neighbours) < kMaxNeighbours) neighbours.push_back(other);
  }
  return neighbours;
}

ResectionStart FrameFinder::PresentPose(FrameId frame) const {
  const Reconstruction& map = *maps_[MapOf(frame)];
  return {map.cam_from_world.at(frame), map.center_in_world.at(frame), std::nullopt};
}

std::optional<TrackId> FrameFinder::PointAt(FrameId frame, const Eigen::Vector2d& px) const {
  constexpr double kMaxDistancePx = 1.5;  // of a corner detected again from its keypoint
  std::optional<TrackId> nearest;
  double least = kMaxDistancePx;
  const auto seen = seen_.find(frame);
  if (seen == seen_.end()) return nearest;
  for (const PointObservation2D3D& observation : seen->second) {
    const double distance = (observation.keypoint_px - px).norm();
    if (distance > least) continue;
    least = distance;
    nearest = observation.track;
  }
  return nearest;
}

void FrameFinder::Recognise(FrameId frame,
                            FrameId match,
                            std::vector<PointObservation2D3D>& recognised) const {
  const Rotation predicted =
      MapOf(frame) == MapOf(match)
          ? PresentPose(frame).cam_from_world * PresentPose(match).cam_from_world.Inverse()
          : Rotation();
  const Features& from = places_.places().at(match);
  const Features& to = places_.places().at(frame);
  for (const Match& pair : places_.Between(match, frame, predicted)) {
    const auto point = PointAt(match, from.keypoints_px[pair.i.value]);
    if (!point) continue;
    const PointObservation2D3D one = {
        *point, maps_[MapOf(match)]->point_in_world.at(*point), to.keypoints_px[pair.j.value]};
    // Neighbours match some of the same points.
    const bool is_known = std::any_of(recognised.begin(), recognised.end(), [&](const auto& other) {
      return other.track == one.track && other.keypoint_px == one.keypoint_px;
    });
    if (!is_known) recognised.push_back(one);
  }
}

bool FrameFinder::Explains(const ResectionStart& pose,
                           const PointObservation2D3D& observation) const {
  const auto pixel = camera_.Project(
      pose.cam_from_world * Eigen::Vector3d(observation.point_in_world - pose.center_in_world));
  return pixel && (*pixel - observation.keypoint_px).norm() <= kMaxErrorPx;
}

std::optional<FoundFrame> FrameFinder::FindPose(
    FrameId frame, int map, const std::vector<PointObservation2D3D>& points) const {
  ResectionOptions resection;
  resection.max_error_px = kMaxErrorPx;
  resection.min_inliers = options_.min_inliers;
  const std::uint64_t seed = seed_ + static_cast<std::uint64_t>(frame.value) * 7919U;
  const auto pose = FindAbsolutePose(camera_, points, resection, seed);
  if (!pose) return std::nullopt;
  FoundFrame found;
  found.frame = frame;
  found.num_inliers = pose->num_inliers;
  if (MapOf(frame) == map) Compare(points, *pose, found);
  found.is_displaced =
      found.num_present + kMinGainSigmas * std::sqrt(pose->num_inliers) < pose->num_inliers;
  found.is_right = found.is_right && !found.is_displaced;
  found.is_near = found.num_agreeing >= options_.min_inliers && !found.is_displaced;
  if (found.is_displaced) Describe(*pose, map, points, found);
  return found;
}

void FrameFinder::Compare(const std::vector<PointObservation2D3D>& points,
                          const ResectedPose& pose,
                          FoundFrame& found) const {
  constexpr double kRightShare = 0.8;  // of the found pose's inliers, if the present one is right
  const ResectionStart present = PresentPose(found.frame);
  const ResectionStart now = {pose.cam_from_world, pose.center_in_world, std::nullopt};
  const std::vector<TrackId>& own = PointsOf(found.frame);
  int num_free_inliers = 0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const bool fits = Explains(present, points[k]);
    found.num_present += fits ? 1 : 0;
    if (std::binary_search(own.begin(), own.end(), points[k].track)) continue;
    found.num_agreeing += fits ? 1 : 0;
    num_free_inliers += Explains(now, points[k]) ? 1 : 0;
  }
  found.is_right = found.num_agreeing >= options_.min_inliers &&
                   found.num_agreeing >= kRightShare * num_free_inliers;
}

void FrameFinder::Describe(const ResectedPose& pose,
                           int map_of_points,
                           const std::vector<PointObservation2D3D>& points,
                           FoundFrame& found) const {
  constexpr int kMinRatios = 5;  // of depths, for a median that tolerates two outliers
  const ResectionStart present = PresentPose(found.frame);
  const ResectionStart now = {pose.cam_from_world, pose.center_in_world, std::nullopt};
  const Reconstruction& map = *maps_[MapOf(found.frame)];
  const bool is_same_map = MapOf(found.frame) == map_of_points;
  std::vector<double> ratios;
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (!Explains(now, points[k])) continue;
    const Eigen::Vector2d& px = points[k].keypoint_px;
    const auto bearing = camera_.Unproject(px);
    if (!bearing) continue;
    found.observations.push_back({points[k].track, {found.frame, px, *bearing, 1.0}});
    const auto own = PointAt(found.frame, px);
    if (!own || (is_same_map && *own == points[k].track)) continue;
    const double depth = (map.point_in_world.at(*own) - present.center_in_world).norm();
    ratios.push_back((points[k].point_in_world - now.center_in_world).norm() / depth);
  }
  Similarity& move = found.move;
  if (std::ssize(ratios) >= kMinRatios) move.scale = Median(ratios);
  move.turn = now.cam_from_world.Inverse() * present.cam_from_world;
  move.shift = now.center_in_world - move.scale * (move.turn * present.center_in_world);
}

}  // namespace rotslam
