#pragma once

#include <map>
#include <mutex>
#include <utility>
#include <vector>

#include "rotodom/camera/camera.h"
#include "rotodom/features/features.h"
#include "rotodom/matching/matching.h"

namespace rotslam {

/// Matches between places, computed once and kept.
class PlaceMatches {
 public:
  /// @param places  described corners of frames, where a global shutter would see them; more may
  /// come. Both must outlive it.
  PlaceMatches(const std::map<FrameId, Features>& places, const Camera& camera)
      : places_(places), camera_(camera) {}

  const std::map<FrameId, Features>& places() const { return places_; }

  /// MatchFeatures of the two places. A pair is matched again only where the prediction has changed
  /// by more than half a degree. May be called from several threads.
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
