#pragma once

#include <filesystem>

#include "apps/slam/orientations.h"

namespace rotslam {

/// Writes rotations_tum.txt, rotations.csv, loops.csv and view_graph.g2o.
void WriteOrientations(const std::filesystem::path& directory, const Orientations& orientations);

}  // namespace rotslam
