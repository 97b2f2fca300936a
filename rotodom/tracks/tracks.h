#pragma once

#include <array>
#include <map>
#include <set>
#include <vector>

#include "rotodom/features/features.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// Matches of one edge that agree with its relative rotation, as pairs of keypoint indices.
struct EdgeMatches {
  FrameId frame_i;
  FrameId frame_j;
  std::vector<std::array<int, 2>> pairs;
};

/// Joins pairwise matches into tracks (union-find). A match that would put two keypoints of one
/// frame into a track is dropped. Earlier edges take precedence, so pass the most reliable ones
/// first.
/// @param features       of every frame that an edge names.
/// @param observed_from  only observations in these frames are returned; those in other frames
///                       still join tracks.
/// @param min_length     tracks with fewer observations are left out.
/// @return  tracks with consecutive ids, ordered by their first frame and keypoint.
/// Cost:    near-linear in the number of matches.
std::vector<Track> BuildTracks(const std::vector<EdgeMatches>& edges,
                               const std::map<FrameId, Features>& features,
                               const std::set<FrameId>& observed_from,
                               int min_length);

}  // namespace rotslam
