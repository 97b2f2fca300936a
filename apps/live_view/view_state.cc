#include "apps/live_view/view_state.h"

#include <cstddef>
#include <utility>

#include "apps/page/encoded_array.h"

namespace rotslam {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxCorrections = 500;

}  // namespace

ViewState::ViewState(const Camera& camera)
    : camera_({{"tan_x", 0.5 * camera.width / camera.fx},
               {"tan_y", 0.5 * camera.height / camera.fy}}) {}

void ViewState::Add(const LiveEstimate& estimate, const LiveViewStats& stats) {
  ++version_;
  samples_.Add(estimate);
  stats_ = stats;
  num_points_used_ = estimate.num_points;
}

void ViewState::SetMap(const std::shared_ptr<const LiveMap>& map) {
  if (map == nullptr || map == map_) return;
  ++version_;
  const int before = map_ ? map_->num_corrections : 0;
  const double first_time_s = samples_.FirstTime();
  if (map->num_corrections > before && !map->keyframes.empty()) {
    if (correction_times_s_.size() == kMaxCorrections) {
      correction_times_s_.erase(correction_times_s_.begin());
    }
    correction_times_s_.push_back(
        static_cast<float>(map->keyframes.back().timestamp_s - first_time_s));
  }
  shown_map_.Update(*map);
  map_ = map;
}

void ViewState::SetImage(Json image) {
  ++version_;
  ++image_version_;
  image_ = std::move(image);
}

void ViewState::Finish() {
  ++version_;
  is_finished_ = true;
}

std::string ViewState::TakeMessage(ViewCursor& cursor) const {
  Json message;
  if (!cursor.has_begun) {
    message["whole"] = true;
    message["camera"] = camera_;
  }
  message["stats"] = {{"latency_ms", stats_.latency_ms},
                      {"frames_per_s", stats_.frames_per_s},
                      {"dropped", stats_.num_dropped},
                      {"loops", stats_.num_loops},
                      {"points_used", num_points_used_}};
  if (samples_.NewestFrame() > cursor.frame) message["samples"] = samples_.After(cursor.frame);
  if (shown_map_.version() > cursor.map) {
    message["map"] = shown_map_.After(cursor.map);
    message["map"]["correction_times_s"] = EncodedArray(correction_times_s_, 1);
  }
  if (image_version_ > cursor.image) message["image"] = image_;
  message["finished"] = is_finished_;
  cursor = {true, version_, samples_.NewestFrame(), shown_map_.version(), image_version_};
  return message.dump();
}

}  // namespace rotslam
