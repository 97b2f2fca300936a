#pragma once

#include <string>
#include <string_view>

#include "rotodom/masks/mask.h"
#include "rotodom/masks/static_content.h"
#include "rotodom/types/maps.h"

namespace rotslam {

/// Decides, while the frames of a sequence come, whether parts of the picture never move. Once
/// static content is found, tracking has to start again from the first frame without it.
class StaticContentDecision {
 public:
  /// @param is_on    off: nothing is looked for.
  /// @param known    of an earlier pass over the same frames; then only a standing camera is news.
  /// @param ignored  what is masked in all frames anyway.
  StaticContentDecision(bool is_on, const StaticContent& known, const Mask& ignored)
      : is_on_(is_on), known_(known), ignored_(ignored) {}

  /// Adds the next frame's image.
  void Add(const cv::Mat& image) {
    if (is_on_) finder_.Add(image);
  }

  /// Static content on the picture, as far as the frames so far show it; nothing where there is
  /// none, none that is new, or too few frames came since the last call.
  /// @param cam_from_world  of the frames so far, as tracked with it.
  StaticContent Decide(const RotationMap& cam_from_world);
  /// The same after the last frame, with what only all frames can tell: a camera that stands, or
  /// that nothing decides.
  StaticContent Finish(const RotationMap& cam_from_world);

  std::string SaveState();
  /// Throws std::runtime_error where the bytes are cut short.
  void RestoreState(std::string_view state);

 private:
  bool IsNew(const StaticContent& content) const;

  bool is_on_;
  const StaticContent& known_;
  const Mask& ignored_;
  StaticContentFinder finder_;
};

}  // namespace rotslam
