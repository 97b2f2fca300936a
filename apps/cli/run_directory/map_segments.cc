#include "apps/cli/run_directory/map_segments.h"

#include <algorithm>
#include <iterator>
#include <set>

namespace rotslam {
namespace {

// The component that a frame's position belongs to: that of the keyframe at or before it.
int ComponentAt(const std::vector<MapComponent>& components, int frame) {
  int found = components.empty() ? -1 : 0;
  for (int k = 0; k < static_cast<int>(components.size()); ++k) {
    if (components[k].keyframes.begin()->value <= frame) found = k;
  }
  return found;
}

// The pure-rotation segment that holds a frame (-1: none), and how the camera moves at the frame.
struct FrameMotion {
  int pure_rotation = -1;
  const char* kind = "translating";

  bool operator==(const FrameMotion& other) const = default;
};

std::vector<FrameMotion> MotionOfFrames(const MapResult& positions) {
  std::vector<FrameMotion> motions(positions.cam_from_world.size());
  for (int k = 0; k < std::ssize(positions.segments); ++k) {
    const PureRotationSegment& segment = positions.segments[k];
    for (int n = segment.first.value; n <= segment.last.value; ++n) motions[n] = {k, "rotating"};
    for (const FrameRange& still : segment.still) {
      for (int n = still.first.value; n <= still.last.value; ++n) motions[n].kind = "still";
    }
  }
  return motions;
}

// How the scale of a segment's component is known. Behind a segment that only turns the same
// component goes on where its tracks, or a loop, reach across.
std::string ScaleOf(const MapResult& positions, int component, int first_frame) {
  if (component < 0) return "none";
  const MapComponent& part = positions.components[component];
  if (part.placed_by_default) return "continuity";
  const auto segment_before = std::find_if(
      positions.segments.rbegin(),
      positions.segments.rend(),
      [&](const PureRotationSegment& segment) { return segment.last.value < first_frame; });
  const bool is_tied = segment_before != positions.segments.rend() &&
                       *part.keyframes.begin() < segment_before->first;
  return is_tied ? "tracks" : "reference";
}

}  // namespace

std::vector<Segment> SegmentsOf(const MapResult& positions) {
  const std::vector<FrameMotion> motions = MotionOfFrames(positions);
  std::set<int> component_starts;
  for (const MapComponent& component : positions.components) {
    component_starts.insert(component.keyframes.begin()->value);
  }
  std::vector<Segment> segments;
  for (int n = 0; n < std::ssize(motions); ++n) {
    const bool begins = n == 0 || motions[n] != motions[n - 1] ||
                        (motions[n].pure_rotation < 0 && component_starts.contains(n));
    if (begins) {
      Segment& segment = segments.emplace_back();
      segment.first_frame = n;
      segment.kind = motions[n].kind;
      const int pure_rotation = motions[n].pure_rotation;
      segment.evidence = pure_rotation < 0 ? 0.0 : positions.segments[pure_rotation].evidence;
      segment.component = ComponentAt(positions.components, n);
      segment.scale = ScaleOf(positions, segment.component, n);
    }
    segments.back().last_frame = n;
  }
  return segments;
}

std::vector<std::string> CommentsOn(const std::vector<Segment>& segments) {
  std::vector<std::string> comments;
  for (const Segment& segment : segments) {
    if (segment.scale != "continuity") continue;
    comments.push_back(
        "frames " + std::to_string(segment.first_frame) + " to " +
        std::to_string(segment.last_frame) + ": " + segment.kind + " on part " +
        std::to_string(segment.component) +
        " of the map, whose scale nothing measures; things stay as far away as before it");
  }
  return comments;
}

}  // namespace rotslam
