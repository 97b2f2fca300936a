#pragma once

#include <array>
#include <span>
#include <vector>

#include "rotodom/features/binary_descriptor.h"
#include "rotodom/features/features.h"
#include "rotodom/loop/vocabulary.h"
#include "rotodom/matching/matching.h"

namespace rotslam {

/// The features of a frame, as matching takes them.
struct OrbView {
  FrameId frame;
  std::vector<Eigen::Vector2d> keypoints_px;
  std::vector<Eigen::Vector3d> bearings;
  std::vector<int> levels;
  std::vector<float> angles_rad;
  std::vector<BinaryDescriptor> descriptors;
};
OrbView ToOrbView(const Features& features);

/// Matches each feature of the newer frame j with those of frame i that lie in the square of
/// 2 radius_px around the same position, on levels at most two apart. The best one counts when it
/// differs in at most max_distance bits and in less than ratio times what the second best does. Of
/// several features of j with the same feature of i the nearest stays.
/// @return  pairs of indices in i and j, ascending in j.
/// Source:  the paper, sec. IV-A; the rules are those of ORB-SLAM2's first match and of MRO.
std::vector<std::array<int, 2>> MatchInWindow(const OrbView& i,
                                              const OrbView& j,
                                              const MatchingOptions& options);

/// Matches the features of two frames that share a node of the vocabulary, wherever they lie. The
/// same rules hold, and the patches of matches must have rotated as those of most have: of twelve
/// classes of 30 deg the three with the most matches stay.
/// @param words_i, words_j  direct indices of the two frames.
/// @return  as MatchInWindow.
/// Source:  ORB-SLAM2's matching by words.
std::vector<std::array<int, 2>> MatchByWords(const OrbView& i,
                                             const DirectIndex& words_i,
                                             const OrbView& j,
                                             const DirectIndex& words_j,
                                             const MatchingOptions& options);

}  // namespace rotslam
