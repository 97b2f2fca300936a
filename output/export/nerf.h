#pragma once

#include <filesystem>

#include "output/map/run_map.h"

namespace rotslam {

/// Writes `transforms.json` as nerfstudio and instant-ngp read it: the camera (OPENCV, or
/// OPENCV_FISHEYE; the principal point gains 0.5, like COLMAP's), and per frame its image, relative
/// to the file's folder, and the pose camera->world in OpenGL's camera axes: x right, y up, z back.
/// The world stays as it is. Numbers read back the same.
/// @param image_folder  where the images are; empty where nobody knows: names alone are written.
/// Throws std::runtime_error when the file cannot be written, and for lenses of kRational and kFov,
/// which neither has a model of: their k4 is a fourth coefficient of the polynomial.
void WriteNerfTransforms(const std::filesystem::path& path,
                         const RunMap& map,
                         const std::filesystem::path& image_folder);

}  // namespace rotslam
