#pragma once

#include <filesystem>

#include "apps/slam/orientations.h"

namespace rotslam {

/// Writes rotations_tum.txt, rotations.csv, loops.csv and view_graph.g2o. Deviations and
/// information are those of the errors: by how triangles of the view-graph close, edges by
/// averaging.edge_error_factor, too.
void WriteOrientations(const std::filesystem::path& directory,
                       const Orientations& orientations,
                       const AveragingOptions& averaging);

/// Writes mask.png, what is ignored in all frames; nothing where nothing is.
void WriteCommonMask(const std::filesystem::path& directory, const FrameMasks& masks);

}  // namespace rotslam
