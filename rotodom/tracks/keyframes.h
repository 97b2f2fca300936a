#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "rotodom/types/maps.h"
#include "rotodom/types/pure_rotation_segment.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// When a frame becomes a keyframe.
struct KeyframeOptions {
  // A frame becomes a keyframe when the median angle between its rays and the last keyframe's,
  // rotation taken out, has grown to this: less gives more keyframes than triangulation gains from.
  double min_parallax_deg = 2.0;
  // It becomes one before fewer than this share of the last keyframe's tracks is left, so that
  // tracks link neighbouring keyframes, also where the camera turns and parallax asks for none.
  double min_shared_ratio = 0.6;
  // And before fewer of its tracks than this share of the last keyframe's have been seen by two
  // keyframes: scale passes from one pair of keyframes to the next by points of known depth alone,
  // and a quick turn takes those away first.
  double min_linked_ratio = 0.2;
  // Where these give fewer keyframes, as of a short walk, less parallax is asked for: half of it,
  // up to four times. Two keyframes give no map, three tell a lens badly.
  int min_keyframes = 5;
  // When positive, every so many frames one is a keyframe instead, whatever it shows; pure-rotation
  // segments have theirs all the same.
  int every_frames = 0;

  std::optional<std::string> Problem() const;

  // Not configuration: the members that are not visited; programs and tests set them.
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("min_parallax_deg", min_parallax_deg);
    visit("min_shared_ratio", min_shared_ratio);
    visit("min_keyframes", min_keyframes);
    visit("every_frames", every_frames);
  }
};

/// The overlap of a frame with a keyframe.
struct ViewOverlap {
  double shared_ratio = 0.0;  // of the keyframe's tracks
  double parallax_rad = 0.0;  // median angle between the rays of shared tracks
};

/// @param keyframe, frame  rays in one world, by track ascending.
ViewOverlap OverlapOf(const std::vector<TrackRay>& keyframe, const std::vector<TrackRay>& frame);

/// Selects the keyframes. The first and the last frame of `cam_from_world` and of every
/// pure-rotation segment are keyframes; there are no others within a segment.
/// @param tracks  over all frames, not only keyframes.
/// Cost:    linear in the number of observations.
std::set<FrameId> SelectKeyframes(const RotationMap& cam_from_world,
                                  const std::vector<Track>& tracks,
                                  const std::vector<PureRotationSegment>& segments,
                                  const KeyframeOptions& options);

}  // namespace rotslam
