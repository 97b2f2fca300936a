#pragma once

#include <filesystem>

#include "output/map/run_map.h"

namespace rotslam {

/// Writes `sfm_data.json` of openMVG (its version 0.3): views, one intrinsic, poses (world->camera
/// rotations and centres) and the points that at least two views explain.
/// openMVG has one focal length, the mean of ours: where the two differ, its points project up to
/// half their difference away at one focal length from the centre. Pixel centres are at integer
/// coordinates, as here.
/// @param image_folder  where the images are, openMVG's root path; may be empty.
/// Throws std::runtime_error when the file cannot be written, and for lenses of kRational and kFov,
/// which openMVG has no model of.
void WriteOpenMvg(const std::filesystem::path& path,
                  const RunMap& map,
                  const std::filesystem::path& image_folder);

}  // namespace rotslam
