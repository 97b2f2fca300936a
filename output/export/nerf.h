#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "output/map/run_map.h"

namespace rotslam {

/// Who reads a transforms.json. The two differ in lenses: instant-ngp has no k3 beside k1, k2, p1
/// and p2, and takes a k3 that stands there for p1 (its nerf_loader.cu, read_lens).
enum class NerfReader {
  kBoth,        // OPENCV with k1 k2 p1 p2, or OPENCV_FISHEYE with k1 to k4
  kNerfstudio,  // OPENCV has k3, too
};

/// Writes `transforms.json` as nerfstudio and instant-ngp read it:
/// - the camera (OPENCV, or OPENCV_FISHEYE; the principal point gains 0.5, like COLMAP's). A lens
///   that the readers have no model of is refitted to the one of theirs that comes nearest;
/// - where the lens zooms, the numbers of the camera per frame instead, which both read;
/// - per frame its image, relative to the file's folder, and the pose camera->world in OpenGL's
///   camera axes: x right, y up, z back. The world stays as it is, which `applied_transform` says:
///   nerfstudio would take another one for granted where a COLMAP model lies beside the file;
/// - `scale`, `offset` and `aabb_scale`, by which instant-ngp has all cameras and points in its box
///   and the cameras and the nearer half of the points in the unit cube; nerfstudio scales by
///   itself;
/// - `ply_file_path`: the points, in a file beside this one whose name ends in "_points.ply"; where
///   there are none the file is not written.
/// Numbers read back the same.
/// @param image_folder  where the images are; empty where nobody knows: names alone are written.
/// @return  what a person should know, one line each: what a refitted lens leaves, and points
///          outside of the box.
/// Throws std::runtime_error when a file cannot be written, or when no lens of the readers comes
/// within 100 px.
std::vector<std::string> WriteNerfTransforms(const std::filesystem::path& path,
                                             const RunMap& map,
                                             const std::filesystem::path& image_folder,
                                             NerfReader reader = NerfReader::kBoth);

}  // namespace rotslam
