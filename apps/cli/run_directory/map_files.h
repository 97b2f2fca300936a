#pragma once

#include <filesystem>

#include "apps/slam/map_result.h"
#include "apps/slam/orientations.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// Writes what `rotslam export` reads: map.bin, the keyframes' map with all their tracks,
/// map_all_frames.bin, the cloud as all frames see it, matches.bin, the verified matches of the
/// view-graph, and thumbnails.bin, what the frames looked like.
/// @param positions  loses the tracks of its cloud, so that they are not in memory twice.
/// @param features   with which the orientations were found.
void WriteMaps(const std::filesystem::path& directory,
               const Sequence& sequence,
               const Orientations& orientations,
               MapResult& positions,
               const FeatureOptions& features);

}  // namespace rotslam
