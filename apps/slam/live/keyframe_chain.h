#pragma once

#include <map>
#include <span>

#include <Eigen/Core>

#include "rotodom/types/ids.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/similarity.h"

namespace rotslam {

/// A keyframe of a map that was built one keyframe after the other.
struct ChainedKeyframe {
  Rotation cam_from_world;
  Eigen::Vector3d center_in_world = Eigen::Vector3d::Zero();
  int part = 0;  // between parts the scale is a guess
};
using KeyframeChain = std::map<FrameId, ChainedKeyframe>;

/// Two keyframes that see the same place: where the newer one is, by the points of the older one.
struct PlaceLink {
  FrameId older;
  FrameId newer;
  // Centre of the newer keyframe in the camera frame of the older one, in the scale there.
  Eigen::Vector3d newer_in_older = Eigen::Vector3d::Zero();
  // What distances around the newer keyframe are to be multiplied by to have that scale.
  double scale = 1.0;
};

/// The chain's orientations as averaged ones have them: what both differ by, slowly as it changes
/// along the chain, is taken over, while neighbours keep their relative rotations, which adjustment
/// has found.
/// @param averaged  orientations in a world of their own; of every keyframe.
/// @return  cam_from_world of every keyframe.
RotationMap BendTo(const RotationMap& averaged, const KeyframeChain& chain);

/// Positions and scales along a chain whose orientations are known anew, so that links close:
/// first the scales, whose logarithms are spread over the chain, then the centres, whose steps keep
/// their directions and lengths as the new orientations and scales have them. Both are linear.
/// @param cam_from_world  of every keyframe.
/// @param kept            pairs (older, newer) that were linked before; they stay as they are.
/// @return  for every keyframe what moves it and what lies around it.
/// Cost:    linear in the keyframes: some milliseconds for a thousand.
/// Source:  Strasdat, Montiel & Davison, Scale Drift-Aware Large Scale Monocular SLAM, RSS 2010;
///          ours has the rotations from averaging, so that nothing is left to iterate.
std::map<FrameId, Similarity> CloseLinks(const KeyframeChain& chain,
                                         const RotationMap& cam_from_world,
                                         std::span<const std::pair<FrameId, FrameId>> kept,
                                         std::span<const PlaceLink> links);

}  // namespace rotslam
