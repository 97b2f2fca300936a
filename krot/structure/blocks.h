#pragma once

#include <map>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// Positions of some views and points in a gauge of their own: scale and origin are free, the axes
/// are the world's.
struct Block {
  CenterMap centers;
  std::map<TrackId, Eigen::Vector3d> points;
};

/// x_world = scale * x_block + shift.
struct BlockPlace {
  double scale = 1.0;
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
};

/// Brings blocks into one gauge by the views and points that they share. Medians measure how much
/// larger one of two blocks is and how far off; least squares with Huber's loss spread over all
/// pairs what they contradict each other by, so that blocks may overlap in a row, come back to a
/// place, or both.
/// @return  by block; those that hang together in the largest number of views have a place, one of
///          them with scale 1 and shift 0.
/// Cost:    linear in what pairs share, cubic in the number of blocks.
std::vector<std::optional<BlockPlace>> JoinBlocks(const std::vector<Block>& blocks);

/// Centres of all views of placed blocks. A view of several gets a mean that goes over from one to
/// the next, in the order of frames.
CenterMap BlendBlocks(const std::vector<Block>& blocks,
                      const std::vector<std::optional<BlockPlace>>& places);

}  // namespace rotslam
