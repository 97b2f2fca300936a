#include "apps/slam/map_correction/place_matches.h"

namespace rotslam {

std::vector<Match> PlaceMatches::Between(FrameId i, FrameId j, const Rotation& predicted_j_from_i) {
  // Largest change of the prediction at which matches are reused: a few pixels, while the search
  // radius is forty.
  constexpr double kSameDeg = 0.5;
  {
    const std::scoped_lock lock(mutex_);
    const auto kept = kept_.find({i, j});
    if (kept != kept_.end()) {
      const auto& [predicted, matches] = kept->second;
      if ((predicted_j_from_i * predicted.Inverse()).AngleDeg() <= kSameDeg) return matches;
    }
  }
  std::vector<Match> matches =
      MatchFeatures(places_.at(i), places_.at(j), predicted_j_from_i, camera_, {}).matches;
  const std::scoped_lock lock(mutex_);
  kept_.insert_or_assign({i, j}, Kept{predicted_j_from_i, matches});
  return matches;
}

}  // namespace rotslam
