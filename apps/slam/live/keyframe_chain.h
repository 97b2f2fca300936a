#pragma once

#include <map>
#include <span>
#include <utility>

#include <Eigen/Core>

#include "rotodom/types/ids.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/similarity.h"

namespace rotslam {

/// A keyframe of a map that was built one keyframe after the other.
struct ChainedKeyframe {
  Rotation cam_from_world;
  Eigen::Vector3d center_in_world = Eigen::Vector3d::Zero();
  int component = 0;  // between components the scale is a guess
};
using KeyframeChain = std::map<FrameId, ChainedKeyframe>;

/// Two keyframes that see the same place: where the newer one is, by the points of the older one.
struct PlaceLink {
  FrameId older;
  FrameId newer;
  // Centre of the newer keyframe in the camera frame of the older one, in the scale there.
  Eigen::Vector3d newer_in_older = Eigen::Vector3d::Zero();
  // Distances around the newer keyframe, multiplied by this, have that scale.
  double scale = 1.0;
};

/// A similarity for every keyframe of a chain: it moves the keyframe and what it sees.
using KeyframeMoves = std::map<FrameId, Similarity>;

/// The move of a frame: that of the keyframe at or before it, else of the first one.
/// @param moves  at least one.
const Similarity& MoveAt(const KeyframeMoves& moves, FrameId frame);

/// Rotates the keyframes of a chain until they follow averaged orientations. Neighbours keep their
/// relative rotations, which adjustment has found: only the difference from the averaged ones that
/// four neighbours on either side have in common is taken over.
/// @param averaged  of every keyframe, in a world of their own.
/// @return  cam_from_world of every keyframe.
RotationMap FollowAveraged(const RotationMap& averaged, const KeyframeChain& chain);

/// Finds positions and scales along a chain with new orientations, so that links close:
/// first the scales, whose logarithms are spread over the chain, then the centres, whose steps keep
/// their directions and lengths as the new orientations and scales have them. Both are linear.
/// @param cam_from_world  of every keyframe.
/// @param kept            pairs (older, newer) that were linked before; they stay as they are.
/// Cost:    linear in the keyframes: some milliseconds for a thousand.
/// Source:  Strasdat, Montiel & Davison, Scale Drift-Aware Large Scale Monocular SLAM, RSS 2010;
///          ours has the rotations from averaging, so that nothing is left to iterate.
KeyframeMoves CloseLinks(const KeyframeChain& chain,
                         const RotationMap& cam_from_world,
                         std::span<const std::pair<FrameId, FrameId>> kept,
                         std::span<const PlaceLink> links);

}  // namespace rotslam
