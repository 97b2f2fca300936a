#pragma once

#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "rotodom/camera/camera.h"
#include "rotodom/features/features.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

/// Where matches are searched, and the tests that they pass.
struct MatchingOptions {
  // Search radius around the position that the predicted rotation gives, for neighbouring frames;
  // it has room for the flow of the translation. Widened when too few matches are found.
  double radius_px = 40.0;
  double wide_radius_px = 150.0;
  // Fewer matches than this in the small radius call for the wide one, and then for the whole
  // image.
  int min_matches = 150;
  // Largest Hamming distance of 256 bits; 64 is far outside what equal patches show under noise.
  int max_distance = 64;
  // The best candidate must be better than the second, if that lies elsewhere, by this ratio.
  double ratio = 0.85;

  std::optional<std::string> Problem() const;

  // Not configuration: the members that are not visited; programs and tests set them.
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("radius_px", radius_px);
    visit("wide_radius_px", wide_radius_px);
    visit("max_distance", max_distance);
    visit("ratio", ratio);
  }
};

/// The same corner in two frames.
struct Match {
  KeypointIndex i;
  KeypointIndex j;
};

enum class SearchRange { kGuided, kWide, kWholeImage };

struct Matches {
  FrameId frame_i;
  FrameId frame_j;
  std::vector<Match> matches;                // ascending in i; each keypoint at most once
  SearchRange range = SearchRange::kGuided;  // how far the search had to go
};

/// Matches the descriptors of two frames near the positions that the predicted rotation gives. A
/// match is the best candidate by the ratio test; of several keypoints of frame i with the same
/// keypoint of frame j only the nearest is kept, and of these only matches whose patches rotate as
/// most do. The search range grows only where too few matches are found.
/// Cost:    n_i times the number of features in the search circle; for 3,000 features in each frame
///          3 ms with a correct prediction, 30 ms for a search over the whole image
///          (matching_bench).
Matches MatchFeatures(const Features& features_i,
                      const Features& features_j,
                      const Rotation& predicted_j_from_i,
                      const Camera& camera,
                      const MatchingOptions& options);

}  // namespace rotslam
