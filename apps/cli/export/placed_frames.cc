#include "apps/cli/export/placed_frames.h"

#include <algorithm>
#include <map>
#include <utility>

#include "output/tables/segments.h"

namespace rotslam {
namespace {

std::vector<Segment> SegmentsOf(const std::filesystem::path& run) {
  const std::filesystem::path file = run / "segments.csv";
  return std::filesystem::exists(file) ? ReadSegmentsCsv(file) : std::vector<Segment>();
}

const Segment* SegmentOf(const std::vector<Segment>& segments, FrameId frame) {
  const auto found = std::find_if(segments.begin(), segments.end(), [&](const Segment& segment) {
    return segment.first_frame <= frame.value && frame.value <= segment.last_frame;
  });
  return found == segments.end() ? nullptr : &*found;
}

bool IsAtRest(const Segment& segment) {
  return segment.kind == "rotating" || segment.kind == "still";
}

// A frame that moves without a map around it has no place.
bool IsPlaced(const Segment& segment) {
  return IsAtRest(segment) || (segment.kind != "unplaced" && segment.component >= 0);
}

using ComponentOfFrame = std::map<FrameId, int>;

// The component that shows most of a track's sightings; -1: none.
int ComponentOf(const MapTrack& entry, const ComponentOfFrame& components) {
  std::map<int, int> votes;
  for (std::size_t k = 0; k < entry.fits.size(); ++k) {
    const auto found = components.find(entry.track.observations[k].frame);
    if (entry.fits[k] && found != components.end()) ++votes[found->second];
  }
  int best = -1;
  for (const auto& [component, count] : votes) {
    if (best < 0 || count > votes[best]) best = component;
  }
  return best;
}

// Moves frames at rest to the component whose points they see more of.
// @param moving  the component of every frame that does not rest.
void AssignFramesAtRest(const RunMap& map, const ComponentOfFrame& moving, ComponentOfFrame& all) {
  std::map<FrameId, std::map<int, int>> seen;
  for (const MapTrack& entry : map.tracks) {
    const int component = entry.point_in_world ? ComponentOf(entry, moving) : -1;
    if (component < 0) continue;
    for (std::size_t k = 0; k < entry.fits.size(); ++k) {
      if (entry.fits[k]) ++seen[entry.track.observations[k].frame][component];
    }
  }
  for (auto& [frame, component] : all) {
    if (moving.contains(frame)) continue;
    int most = seen[frame][component];
    for (const auto& [other, count] : seen[frame]) {
      if (count <= most) continue;
      most = count;
      component = other;
    }
  }
}

}  // namespace

PlacedFrames FindPlacedFrames(const std::filesystem::path& run, const RunMap& map) {
  const std::vector<Segment> segments = SegmentsOf(run);
  std::set<int> untied;
  for (const Segment& segment : segments) {
    if (segment.scale == "continuity") untied.insert(segment.component);
  }
  PlacedFrames placed;
  ComponentOfFrame components;
  ComponentOfFrame moving;
  for (const MapFrame& frame : map.frames) {
    const Segment* segment = SegmentOf(segments, frame.id);
    if (segment != nullptr && !IsPlaced(*segment)) {
      placed.unplaced.insert(frame.id);
      continue;
    }
    const int component =
        segment != nullptr && untied.contains(segment->component) ? segment->component : 0;
    components[frame.id] = component;
    if (segment == nullptr || !IsAtRest(*segment)) moving[frame.id] = component;
  }
  if (!untied.empty()) AssignFramesAtRest(map, moving, components);
  std::map<int, std::set<FrameId>> frames;
  for (const auto& [frame, component] : components) frames[component].insert(frame);
  for (auto& [component, of_component] : frames) {
    placed.components.push_back(std::move(of_component));
  }
  std::sort(placed.components.begin(), placed.components.end(), [](const auto& a, const auto& b) {
    return *a.begin() < *b.begin();
  });
  return placed;
}

std::set<FrameId> FramesAtRest(const std::filesystem::path& run, const RunMap& map) {
  const std::vector<Segment> segments = SegmentsOf(run);
  std::set<FrameId> frames;
  for (const MapFrame& frame : map.frames) {
    const Segment* segment = SegmentOf(segments, frame.id);
    if (segment != nullptr && IsAtRest(*segment)) frames.insert(frame.id);
  }
  return frames;
}

std::string DescribeFrames(const std::set<FrameId>& frames) {
  constexpr int kMaxRanges = 8;
  std::string text;
  int num_ranges = 0;
  for (auto frame = frames.begin(); frame != frames.end();) {
    if (++num_ranges > kMaxRanges) return text + ", ...";
    const int first = frame->value;
    int last = first;
    for (++frame; frame != frames.end() && frame->value == last + 1; ++frame) ++last;
    text += (text.empty() ? "" : ", ") + std::to_string(first);
    if (last > first) text += "-" + std::to_string(last);
  }
  return text;
}

}  // namespace rotslam
