#include "rotodom/tracks/keyframes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>

#include "rotodom/types/median.h"
#include "rotodom/types/options.h"

namespace rotslam {

ViewOverlap OverlapOf(const std::vector<TrackRay>& keyframe, const std::vector<TrackRay>& frame) {
  std::vector<double> angles;
  auto other = frame.begin();
  for (const TrackRay& ray : keyframe) {
    while (other != frame.end() && other->track < ray.track) ++other;
    if (other == frame.end()) break;
    if (other->track != ray.track) continue;
    const double sine = ray.ray_in_world.cross(other->ray_in_world).norm();
    angles.push_back(std::atan2(sine, ray.ray_in_world.dot(other->ray_in_world)));
  }
  if (angles.empty()) return {};
  const double overlap = static_cast<double>(angles.size()) / static_cast<double>(keyframe.size());
  return {overlap, Median(std::move(angles))};
}

namespace {

// Number of keyframes so far that see each track.
class KeyframeCounts {
 public:
  explicit KeyframeCounts(std::size_t num_tracks) : counts_(num_tracks, 0) {}

  void Add(const std::vector<TrackRay>& keyframe) {
    for (const TrackRay& ray : keyframe) ++counts_[ray.track];
  }
  // Number of a frame's tracks seen by two keyframes: their points have depth and propagate the
  // scale.
  int NumLinks(const std::vector<TrackRay>& frame) const {
    return static_cast<int>(std::count_if(
        frame.begin(), frame.end(), [&](const TrackRay& ray) { return counts_[ray.track] >= 2; }));
  }

 private:
  std::vector<int> counts_;
};

// Selects keyframes in one pass over the frames.
// @param rays_of  rays of every frame with tracks.
std::set<FrameId> SelectFrom(const RotationMap& cam_from_world,
                             const std::map<FrameId, std::vector<TrackRay>>& rays_of,
                             std::size_t num_tracks,
                             const std::vector<PureRotationSegment>& segments,
                             const KeyframeOptions& options) {
  std::set<FrameId> keyframes;
  KeyframeCounts counts(num_tracks);
  static const std::vector<TrackRay> kNoRays;
  const auto rays = [&](FrameId frame) -> const std::vector<TrackRay>& {
    const auto entry = rays_of.find(frame);
    return entry == rays_of.end() ? kNoRays : entry->second;
  };
  FrameId keyframe = cam_from_world.begin()->first;
  FrameId before = keyframe;  // newest frame that could still become a keyframe
  const auto take = [&](FrameId frame) {
    if (keyframes.insert(frame).second) counts.Add(rays(frame));
    keyframe = frame;
  };
  take(keyframe);
  for (const auto& [frame, rotation] : cam_from_world) {
    const auto segment = std::find_if(
        segments.begin(), segments.end(), [&, f = frame](const PureRotationSegment& s) {
          return s.first <= f && f <= s.last;
        });
    if (segment != segments.end()) {
      if (frame == segment->first || frame == segment->last) take(frame);
      before = frame;
      continue;
    }
    if (rays(frame).empty()) continue;
    if (options.every_frames > 0) {
      if (frame.value - keyframe.value >= options.every_frames) take(frame);
      continue;
    }
    ViewOverlap overlap = OverlapOf(rays(keyframe), rays(frame));
    const double least_links =
        options.min_linked_ratio * static_cast<double>(rays(keyframe).size());
    const bool breaks = keyframes.size() > 1 && counts.NumLinks(rays(frame)) < least_links;
    if ((overlap.shared_ratio < options.min_shared_ratio || breaks) && before > keyframe) {
      // This frame shares too few tracks; the frame before becomes the keyframe.
      take(before);
      overlap = OverlapOf(rays(keyframe), rays(frame));
    }
    if (overlap.parallax_rad >= options.min_parallax_deg * kRadFromDeg ||
        overlap.shared_ratio < options.min_shared_ratio) {
      take(frame);
    }
    before = frame;
  }
  keyframes.insert(cam_from_world.rbegin()->first);
  return keyframes;
}

}  // namespace

std::optional<std::string> KeyframeOptions::Problem() const {
  if (!(min_parallax_deg > 0.0)) {
    return OutOfRange("min_parallax_deg", min_parallax_deg, "positive");
  }
  if (!(min_shared_ratio >= 0.0 && min_shared_ratio < 1.0)) {
    return OutOfRange("min_shared_ratio", min_shared_ratio, "0 or more and below 1");
  }
  if (!(min_linked_ratio >= 0.0 && min_linked_ratio < 1.0)) {
    return OutOfRange("min_linked_ratio", min_linked_ratio, "0 or more and below 1");
  }
  if (min_keyframes < 0) return OutOfRange("min_keyframes", min_keyframes, "at least 0");
  if (every_frames < 0) return OutOfRange("every_frames", every_frames, "at least 0");
  return std::nullopt;
}

std::set<FrameId> SelectKeyframes(const RotationMap& cam_from_world,
                                  const std::vector<Track>& tracks,
                                  const std::vector<PureRotationSegment>& segments,
                                  const KeyframeOptions& options) {
  if (const auto problem = options.Problem())
    throw std::invalid_argument("KeyframeOptions: " + *problem);
  if (cam_from_world.empty()) return {};
  const auto rays_of = RaysByFrame(cam_from_world, tracks);
  constexpr int kMaxHalvings = 4;  // of the parallax, see KeyframeOptions::min_keyframes
  KeyframeOptions asked = options;
  std::set<FrameId> keyframes = SelectFrom(cam_from_world, rays_of, tracks.size(), segments, asked);
  for (int k = 0; k < kMaxHalvings && options.every_frames == 0; ++k) {
    if (static_cast<int>(keyframes.size()) >= options.min_keyframes) break;
    asked.min_parallax_deg /= 2.0;
    keyframes = SelectFrom(cam_from_world, rays_of, tracks.size(), segments, asked);
  }
  return keyframes;
}

}  // namespace rotslam
