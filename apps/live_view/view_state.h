#pragma once

#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "apps/live_view/live_view_frame.h"
#include "apps/live_view/shown_map.h"
#include "apps/live_view/shown_samples.h"
#include "rotodom/camera/camera.h"

namespace rotslam {

/// The newest version of everything that one browser has been sent.
struct ViewCursor {
  bool has_begun = false;
  int state = 0;  // version of the whole
  int frame = -1;
  int map = 0;
  int image = 0;
};

/// All that a page shows of a session, in bounded memory. A browser's message is made when it can
/// take one and holds what has changed since its last one: a slow browser gets fewer and larger
/// messages, and nothing waits for it.
class ViewState {
 public:
  explicit ViewState(const Camera& camera);

  void Add(const LiveEstimate& estimate, const LiveViewStats& stats);
  void SetMap(const std::shared_ptr<const LiveMap>& map);  // null: there is none
  void SetImage(nlohmann::ordered_json image);
  void Finish();
  bool is_finished() const { return is_finished_; }

  /// Whether anything has changed for this browser.
  bool IsAhead(const ViewCursor& cursor) const {
    return !cursor.has_begun || cursor.state != version_;
  }

  /// Everything that has changed, as one line of JSON. The first message of a browser has "whole"
  /// and everything.
  std::string TakeMessage(ViewCursor& cursor) const;

 private:
  nlohmann::ordered_json camera_;
  int version_ = 1;
  LiveViewStats stats_;
  int num_points_used_ = 0;
  ShownSamples samples_;
  std::shared_ptr<const LiveMap> map_;
  ShownMap shown_map_;
  std::vector<float> correction_times_s_;  // of the newest ones
  nlohmann::ordered_json image_;
  int image_version_ = 0;
  bool is_finished_ = false;
};

}  // namespace rotslam
