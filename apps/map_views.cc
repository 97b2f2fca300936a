#include "apps/map_views.h"

#include <algorithm>
#include <exception>
#include <iterator>
#include <memory>
#include <optional>

#include "rotodom/tracking/shutter.h"

namespace rotslam {

MapViews ReadMapViews(const std::string& path,
                      const SequenceOptions& options,
                      const std::set<FrameId>& frames,
                      const std::function<void(const std::string&)>& tell) {
  MapViews views;
  try {
    const std::unique_ptr<Sequence> sequence = OpenSequence(path, options);
    int next = 0;
    for (const FrameId wanted : frames) {
      sequence->Skip(wanted.value - next);
      next = wanted.value + 1;
      const std::optional<Frame> frame = sequence->Next();
      if (!frame) {
        tell(path + ": ends before frame " + std::to_string(wanted.value));
        return views;
      }
      if (frame->image.empty()) {
        tell(path + ": " + frame->name + ": " + frame->problem);
        continue;
      }
      views[wanted] = MakeMapView(frame->image);
    }
  } catch (const std::exception& error) {
    tell(error.what());
  }
  return views;
}

void SetMotions(const Orientations& orientations, const Reconstruction& map, MapViews& views) {
  const auto last_frame = static_cast<int>(orientations.timestamps_s.size()) - 1;
  for (auto& [frame, view] : views) {
    const FrameId before{std::max(0, frame.value - 1)};
    const FrameId after{std::min(last_frame, frame.value + 1)};
    const auto time_s = [&](FrameId id) { return orientations.timestamps_s[id.value]; };
    const auto first = orientations.cam_from_world.find(before);
    const auto second = orientations.cam_from_world.find(after);
    if (first != orientations.cam_from_world.end() && second != orientations.cam_from_world.end() &&
        time_s(after) > time_s(before)) {
      view.rate =
          (second->second * first->second.Inverse()).Log() / (time_s(after) - time_s(before));
    }
    const auto center = map.center_in_world.find(frame);
    if (center == map.center_in_world.end()) continue;
    const auto next = std::next(center);
    const auto to = next == map.center_in_world.end() ? center : next;
    const auto from = center == map.center_in_world.begin() ? center : std::prev(center);
    const double seconds = time_s(to->first) - time_s(from->first);
    if (seconds > 0.0) view.velocity = (to->second - from->second) / seconds;
  }
}

std::map<FrameId, Features> DescribeViews(const MapViews& views,
                                          const Camera& camera,
                                          const FeatureOptions& options,
                                          int num_threads) {
  std::map<FrameId, Features> described;
  for (const auto& [frame, view] : views) {
    Features& corners = described[frame];
    corners = ExtractFeatures(view.image, frame, camera, options, num_threads);
    corners.rgb = {};
    MoveToMidFrame(camera, view.rate, corners);
  }
  return described;
}

}  // namespace rotslam
