#pragma once

#include <map>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// Positions of some views and points with an origin and scale of their own; the axes are the
/// world's.
struct Block {
  CenterMap centers;
  std::map<TrackId, Eigen::Vector3d> points;
};

/// x_world = scale * x_block + shift.
struct BlockPlace {
  double scale = 1.0;
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
};

/// Transforms blocks into one gauge by the views and points that they share. Scale and shift
/// between two blocks are medians. Least squares with Huber's loss distributes the contradictions
/// over all pairs, so that blocks may overlap in a row, return to a place, or both.
/// @return  by block; set for the largest connected group in number of views, one of its blocks
///          having scale 1 and shift 0.
/// Cost:    linear in the shared views and points, cubic in the number of blocks.
std::vector<std::optional<BlockPlace>> JoinBlocks(const std::vector<Block>& blocks);

/// Centres of all views of blocks with a place. A view of several blocks gets a weighted mean,
/// whose weights change linearly from one block to the next in the order of frames.
CenterMap BlendBlocks(const std::vector<Block>& blocks,
                      const std::vector<std::optional<BlockPlace>>& places);

}  // namespace rotslam
