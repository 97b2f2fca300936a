#include "apps/cli/run_directory/map_segments.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "output/tables/poses_csv.h"

namespace rotslam {
namespace {

// The pure-rotation segment that holds a frame (-1: none), how the camera moves at the frame, and
// the component of the map that it belongs to; within a pure rotation that of its first frame.
struct FrameMotion {
  int pure_rotation = -1;
  const char* kind = "translating";
  int component = -1;

  bool operator==(const FrameMotion& other) const = default;
};

std::vector<FrameMotion> MotionOfFrames(const MapResult& positions) {
  std::vector<FrameMotion> motions(positions.cam_from_world.size());
  for (const auto& [frame, pose] : positions.frame_poses) {
    motions[frame.value].component = pose.component;
    if (pose.state == PoseState::kUnplaced) motions[frame.value].kind = "unplaced";
  }
  for (int k = 0; k < std::ssize(positions.segments); ++k) {
    const PureRotationSegment& segment = positions.segments[k];
    const int component = motions[segment.first.value].component;
    for (int n = segment.first.value; n <= segment.last.value; ++n) {
      motions[n] = {k, "rotating", component};
    }
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
  std::vector<Segment> segments;
  for (int n = 0; n < std::ssize(motions); ++n) {
    if (n == 0 || motions[n] != motions[n - 1]) {
      Segment& segment = segments.emplace_back();
      segment.first_frame = n;
      segment.kind = motions[n].kind;
      const int pure_rotation = motions[n].pure_rotation;
      segment.evidence = pure_rotation < 0 ? 0.0 : positions.segments[pure_rotation].evidence;
      segment.component = motions[n].component;
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

std::vector<std::string> CommentsOn(const std::map<FrameId, FramePose>& poses) {
  // A note's figures are the frame's own; poses.csv has them.
  const auto reason_of = [](const FramePose& pose) {
    const std::string note = pose.note.substr(0, pose.note.find(':'));
    return std::string(Name(pose.state)) + (note.empty() ? "" : ", " + note);
  };
  std::vector<std::string> comments;
  for (auto first = poses.begin(); first != poses.end();) {
    auto end = std::next(first);
    auto last = first;
    while (end != poses.end() && end->second.state == first->second.state &&
           reason_of(end->second) == reason_of(first->second)) {
      last = end++;
    }
    if (first->second.state != PoseState::kMeasured) {
      const std::string number = std::to_string(first->first.value);
      const std::string frames =
          last == first ? "frame " + number
                        : "frames " + number + " to " + std::to_string(last->first.value);
      comments.push_back(frames + ": " + reason_of(first->second));
    }
    first = end;
  }
  return comments;
}

}  // namespace rotslam
