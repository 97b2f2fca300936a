#pragma once

#include <map>
#include <mutex>
#include <utility>
#include <vector>

#include "rotodom/camera/camera.h"
#include "rotodom/features/features.h"
#include "rotodom/matching/matching.h"

namespace rotslam {

/// Matches between places, kept for whoever asks again.
class PlaceMatches {
 public:
  /// @param places  described corners of frames, where a global shutter would see them; more may
  /// come. Both must outlive it.
  PlaceMatches(const std::map<FrameId, Features>& places, const Camera& camera)
      : places_(places), camera_(camera) {}

  const std::map<FrameId, Features>& places() const { return places_; }

  /// As MatchFeatures of the two places. A pair is matched again only where the prediction has
  /// turned by more than half a degree since. Several threads may ask.
  std::vector<Match> Between(FrameId i, FrameId j, const Rotation& predicted_j_from_i);

 private:
  struct Kept {
    Rotation predicted_j_from_i;
    std::vector<Match> matches;
  };

  const std::map<FrameId, Features>& places_;
  const Camera& camera_;
  std::mutex mutex_;
  std::map<std::pair<FrameId, FrameId>, Kept> kept_;
};

}  // namespace rotslam
